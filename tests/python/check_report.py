"""Opens report.html of runs in headless Chromium: `python tests/python/check_report.py OUT RUN...`.

No request may leave the page and nothing may be logged as an error; the viewer must draw, and draw something else when its slider
moves and when it is turned. Without WebGL the pictures must be there. Screenshots, and the page as it prints, go to the folder OUT.
Needs `pip install playwright` and a Chromium: that of `playwright install chromium`, or the one that CHROMIUM names.
"""

import os
import pathlib
import sys

from playwright.sync_api import sync_playwright

out = pathlib.Path(sys.argv[1])
out.mkdir(parents=True, exist_ok=True)
WEBGL = ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"]


def open_page(playwright, run, arguments):
    browser = playwright.chromium.launch(executable_path=os.environ.get("CHROMIUM"), args=["--no-sandbox", *arguments])
    page = browser.new_page(viewport={"width": 1100, "height": 900})
    requests, said = [], []
    page.on("request", lambda request: requests.append(request.url))
    page.on("console", lambda message: said.append(f"{message.type}: {message.text}") if message.type in ("error", "warning") else None)
    page.on("pageerror", lambda error: said.append(str(error)))
    page.goto((run / "report.html").resolve().as_uri())
    page.wait_for_timeout(600)
    return browser, page, requests, said


def quiet(requests, said):
    away = [url for url in requests[1:] if not url.startswith("data:")]
    assert not away, f"requests leave the page: {away}"
    # the software renderer of a test machine warns about its own speed
    errors = [line for line in said if "GPU stall" not in line and "swiftshader" not in line.lower()]
    assert not errors, errors


def canvas(page):
    page.wait_for_timeout(300)
    return page.locator("#viewer canvas").screenshot()


def pictures_of_the_readme(page, run):
    """The page down to the end of its viewer, and what the markers tell: problems/beam/report.png and told.png."""
    viewer, told = page.locator("section", has=page.locator("#viewer")), page.locator("section#what-the-markers-can-and-cannot-tell")
    if viewer.count() and told.count():
        box = viewer.first.bounding_box()
        whole = {"x": 0, "y": 0, "width": 1100, "height": box["y"] + box["height"]}
        page.screenshot(path=out / f"{run.name}_report.png", full_page=True, clip=whole)
        told.first.screenshot(path=out / f"{run.name}_told.png")


def check(playwright, run):
    browser, page, requests, said = open_page(playwright, run, WEBGL)
    assert "not a diagnosis" in page.inner_text("body")
    wide = page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth")
    assert wide <= 0, f"the page is {wide} pixels wider than the window"
    if page.locator("#viewer").count():
        assert page.locator("#viewer.live").count(), "WebGL did not start"
        before = canvas(page)
        slider = page.locator("#viewer [name=frame]")
        frames = int(slider.get_attribute("max")) + 1
        if frames > 1:
            slider.fill("0")
            label = page.inner_text("#viewer output")
            at_start = canvas(page)
            (out / f"{run.name}_start.png").write_bytes(at_start)
            assert before != at_start, "the slider changes nothing"
            page.locator("#viewer button").click()
            page.wait_for_timeout(400)
            assert page.inner_text("#viewer output") != label, "it does not play"
            page.locator("#viewer button", has_text="play").wait_for(timeout=30000)
            slider.fill(str(frames // 2))
        box = page.locator("#viewer canvas").bounding_box()
        page.mouse.move(box["x"] + 300, box["y"] + 200)
        page.mouse.down()
        page.mouse.move(box["x"] + 380, box["y"] + 230)
        page.mouse.up()
        assert canvas(page) != before, "dragging turns nothing"
        page.locator("#viewer [name=skin]").uncheck()
        canvas(page)
        page.locator("#viewer [name=skin]").check()
        (out / f"{run.name}_viewer.png").write_bytes(canvas(page))
    page.screenshot(path=out / f"{run.name}.png", full_page=True)
    pictures_of_the_readme(page, run)
    page.pdf(path=out / f"{run.name}.pdf", format="A4", print_background=True)
    quiet(requests, said)
    browser.close()

    # where there is no WebGL
    browser, page, requests, said = open_page(playwright, run, ["--disable-gpu", "--disable-3d-apis"])
    if page.locator("#viewer").count():
        assert not page.locator("#viewer.live").count()
        assert page.locator(".pictures svg").first.is_visible(), "no picture in place of the viewer"
    quiet(requests, said)
    browser.close()
    print(f"{run.name}: the page opens, plays and prints; no request, no error")


with sync_playwright() as playwright:
    for name in sys.argv[2:]:
        check(playwright, pathlib.Path(name))
