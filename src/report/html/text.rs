//! The pages of studies and of fibres: their text and their pictures in the same frame.

use super::frame::{Page, escape};
use super::run::standing;
use crate::error::{Error, Result};
use crate::report::status::Status;
use std::path::Path;

/// `study.md` with its pictures.
pub(super) fn study(folder: &Path, status: &Status) -> Result<String> {
    let markdown = read(folder, "study.md")?;
    let title = markdown.lines().find_map(|line| line.strip_prefix("# ")).unwrap_or("Study").to_owned();
    let mut page = Page::new(&title, "What accuracy costs.");
    standing(&mut page, status);
    // the text before the first heading, then a section per heading
    let mut parts = markdown.split("\n## ");
    let first = parts.next().unwrap_or_default();
    let first: Vec<&str> = first.lines().filter(|line| !line.starts_with("# ")).collect();
    page.section("Variants", &html(&first.join("\n"), folder)?);
    for part in parts {
        let (heading, text) = part.split_once('\n').unwrap_or((part, ""));
        page.section(heading, &html(text, folder)?);
    }
    Ok(page.html())
}

/// `summary.txt` with `fibres.svg`.
pub(super) fn fibres(folder: &Path, status: &Status) -> Result<String> {
    let summary = read(folder, "summary.txt")?;
    let name = summary.split(':').next().unwrap_or("Fibres").to_owned();
    let mut page = Page::new(&name, "Fibre angles fitted to measured directions.");
    standing(&mut page, status);
    if let Ok(picture) = read(folder, "fibres.svg") {
        page.section("Fibres", &picture);
    }
    page.section("Summary", &format!("<pre>{}</pre>", escape(&summary)));
    Ok(page.html())
}

fn read(folder: &Path, name: &str) -> Result<String> {
    let path = folder.join(name);
    std::fs::read_to_string(&path).map_err(|source| Error::Io { action: "read", path, source })
}

/// The Markdown that a study writes: paragraphs, lists, tables, bold words, pictures.
fn html(markdown: &str, folder: &Path) -> Result<String> {
    let mut out = String::new();
    let mut lines = markdown.lines().peekable();
    while let Some(line) = lines.next() {
        if let Some(picture) = line.strip_prefix("![") {
            let name = picture.split_once('(').and_then(|(_, rest)| rest.strip_suffix(')')).unwrap_or_default();
            // as it stands in the file: nothing is loaded
            out += &read(folder, name)?;
        } else if line.starts_with('|') {
            let mut rows = vec![line];
            rows.extend(std::iter::from_fn(|| lines.next_if(|line| line.starts_with('|'))));
            let row = |tag: &str, line: &str| {
                let cells =
                    line.trim_matches('|').split('|').map(|cell| format!("<{tag}>{}</{tag}>", inline(cell.trim())));
                format!("<tr>{}</tr>\n", cells.collect::<String>())
            };
            let body = rows.iter().skip(1).filter(|line| !line.starts_with("|---")).map(|line| row("td", line));
            out += &format!(
                "<div class=\"wide\"><table>\n{}{}</table></div>\n",
                row("th", rows[0]),
                body.collect::<String>()
            );
        } else if let Some(item) = line.strip_prefix("- ") {
            out += &format!("<ul><li>{}</li>", inline(item));
            while let Some(item) = lines.next_if(|line| line.starts_with("- ")) {
                out += &format!("<li>{}</li>", inline(&item[2..]));
            }
            out += "</ul>\n";
        } else if !line.is_empty() {
            out += &format!("<p>{}</p>\n", inline(line));
        }
    }
    Ok(out)
}

/// Every second part between ** is bold.
fn inline(text: &str) -> String {
    let parts = text.split("**").enumerate();
    parts.map(|(k, part)| if k % 2 == 1 { format!("<b>{}</b>", escape(part)) } else { escape(part) }).collect()
}
