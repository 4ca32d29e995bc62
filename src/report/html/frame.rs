//! The frame of every page: one file, nothing from outside, prints on paper.

use std::fmt::Write as _;

const STYLE: &str = include_str!("style.css");
/// What a browser may do with a page: run what stands in it, ask for nothing.
const POLICY: &str = include_str!("policy.html");

/// A page that grows section by section.
#[derive(Debug, Default)]
pub(super) struct Page {
    title: String,
    header: String,
    contents: Vec<(String, String)>,
    body: String,
    script: &'static str,
}

impl Page {
    /// With a title, and a line below it.
    pub fn new(title: &str, line: &str) -> Page {
        let header = format!("<header><h1>{}</h1><p>{}</p></header>\n", escape(title), escape(line));
        Page { title: title.into(), header, ..Page::default() }
    }

    /// Adds a section; `inside` is HTML.
    pub fn section(&mut self, heading: &str, inside: &str) {
        let id: String = heading.to_lowercase().chars().map(|c| if c.is_alphanumeric() { c } else { '-' }).collect();
        let _ = writeln!(self.body, "<section id=\"{id}\"><h2>{}</h2>\n{inside}\n</section>", escape(heading));
        self.contents.push((id, heading.into()));
    }

    /// A script at the end of the page.
    pub fn script(&mut self, script: &'static str) {
        self.script = script;
    }

    /// The whole file. The policy in its head forbids the page to ask for anything.
    pub fn html(&self) -> String {
        let links = self.contents.iter().map(|(id, heading)| format!("<a href=\"#{id}\">{}</a>", escape(heading)));
        format!(
            "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
             {POLICY}\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<link rel=\"icon\" href=\"data:,\">\n\
             <title>{}</title>\n<style>\n{STYLE}</style>\n</head>\n<body>\n<p class=\"only\">Research use only, not a diagnosis.</p>\n{}\
             <nav>{}</nav>\n{}<footer>Research use only, not a diagnosis. Written by risorius {}.</footer>\n{}</body>\n</html>\n",
            escape(&self.title),
            self.header,
            links.collect::<Vec<_>>().join(" "),
            self.body,
            env!("CARGO_PKG_VERSION"),
            if self.script.is_empty() { String::new() } else { format!("<script>\n{}</script>\n", self.script) }
        )
    }
}

/// Text in HTML, also between the quotes of an attribute.
pub(super) fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// A table; the cells are text.
pub(super) fn table<const N: usize>(header: [&str; N], rows: &[[String; N]]) -> String {
    let line = |tag: &str, cells: [&str; N]| {
        let cells = cells.map(|cell| format!("<{tag}>{}</{tag}>", escape(cell)));
        format!("<tr>{}</tr>\n", cells.concat())
    };
    let rows = rows.iter().map(|row| line("td", row.each_ref().map(String::as_str)));
    format!("<div class=\"wide\"><table>\n{}{}</table></div>\n", line("th", header), rows.collect::<String>())
}
