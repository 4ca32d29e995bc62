//! `risorius explain CODE`: what a code means, and what to do about it.

use super::Ending;
use super::terminal::print;
use crate::error::Result;
use crate::error::explain::{Page, families, page};

/// Columns of the page.
const WIDTH: usize = 100;

/// Prints the pages of codes; without any, a line for each code there is.
pub(super) fn explain(pages: &[Page]) -> Result<Ending> {
    let text = match pages {
        [] => index(),
        pages => pages.iter().map(shown).collect::<Vec<_>>().join("\n"),
    };
    print(&text)?;
    Ok(Ending::Ok)
}

/// A code of the command line.
pub(super) fn code(text: &str) -> std::result::Result<Page, String> {
    page(text).map_err(|nearest| match nearest {
        Some(code) => format!("there is no such code; did you mean {code}?"),
        None => "there is no such code; `risorius explain` lists all of them".into(),
    })
}

fn index() -> String {
    let mut text = String::new();
    for family in families() {
        text += &format!("{}\n", family.title);
        family.pages.iter().for_each(|page| text += &format!("  {}  {}\n", page.code, page.title));
    }
    text + "\none of them in full: risorius explain S003\n"
}

fn shown(page: &Page) -> String {
    let mut text = format!("{}: {}\n\n", page.code, page.title);
    for line in page.text.lines() {
        // quoted messages and tables keep their lines
        let indent = if line.starts_with("- ") { "  " } else { "" };
        text += &if line.starts_with([' ', '|']) { format!("{line}\n") } else { wrapped(line, indent) };
    }
    text
}

/// A paragraph in lines of at most [`WIDTH`] characters; all but the first are indented.
fn wrapped(paragraph: &str, indent: &str) -> String {
    let mut text = String::new();
    let mut column = 0;
    for word in paragraph.split(' ') {
        let length = word.chars().count();
        if column > 0 && column + 1 + length > WIDTH {
            text += &format!("\n{indent}");
            column = indent.len();
        } else if column > 0 {
            text.push(' ');
            column += 1;
        }
        text += word;
        column += length;
    }
    text + "\n"
}
