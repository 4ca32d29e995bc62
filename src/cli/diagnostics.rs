//! Errors and warnings as a reader of a terminal wants them: code, message, the line that caused it, the remedy.

use crate::error::{Error, Place, Warning};
use annotate_snippets::renderer::DecorStyle;
use annotate_snippets::{AnnotationKind, Group, Level, Origin, Renderer, Snippet, normalize_untrusted_str};
use std::io::IsTerminal;

/// When messages are coloured: `--color`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Colour {
    /// If standard error is a terminal, `NO_COLOR` is unset or empty, and `TERM` is not `dumb`.
    #[default]
    Auto,
    /// Also into a file or a pipe.
    Always,
    /// Plain text.
    Never,
}

impl Colour {
    /// Whether to colour what goes to standard error.
    pub fn on(self) -> bool {
        match self {
            Colour::Always => true,
            Colour::Never => false,
            Colour::Auto => {
                let set = |name| std::env::var_os(name).unwrap_or_default();
                set("NO_COLOR").is_empty() && set("TERM") != "dumb" && std::io::stderr().is_terminal()
            }
        }
    }
}

/// The text of an error: each of its mistakes with code, message, excerpt and help, and their number at the end if
/// there are several. Ends with a newline.
pub fn render_error(error: &Error, colour: bool) -> String {
    let mistakes = error.mistakes();
    let messages = mistakes.iter().map(|mistake| {
        render(Level::ERROR, mistake.code(), &mistake.to_string(), mistake.place(), mistake.help(), colour)
    });
    let mut text = messages.collect::<Vec<_>>().join("\n");
    if mistakes.len() > 1 {
        let total = format!("{} mistakes, nothing was run", mistakes.len());
        let total = Group::with_title(Level::ERROR.primary_title(total));
        text = format!("{text}\n{}\n", renderer(colour).render(&[total]));
    }
    text
}

/// The text of a warning, in the same form as an error. Ends with a newline.
pub fn render_warning(warning: &Warning, colour: bool) -> String {
    let Warning { code, message, place, help } = warning;
    render(Level::WARNING.with_name("warn"), code, message, place.as_ref(), help.clone(), colour)
}

fn renderer(colour: bool) -> Renderer {
    if colour { Renderer::styled() } else { Renderer::plain() }.decor_style(DecorStyle::Ascii)
}

fn render(
    level: Level<'_>,
    code: &str,
    message: &str,
    place: Option<&Place>,
    help: Option<String>,
    colour: bool,
) -> String {
    // Messages quote files, and a file may hold the control sequences of a terminal.
    let title = level.primary_title(normalize_untrusted_str(message)).id(code);
    let mut group = Group::with_title(title);
    if let Some(place) = place {
        group = match place.line {
            0 => group.element(Origin::path(&*place.file)),
            _ => group.element(
                Snippet::source(&*place.text)
                    .path(&*place.file)
                    .line_start(place.line as usize)
                    .annotation(AnnotationKind::Primary.span(bytes(place))),
            ),
        };
    }
    if let Some(help) = &help {
        group = group.element(Level::HELP.message(normalize_untrusted_str(help)));
    }
    renderer(colour).render(&[group]) + "\n"
}

/// The bytes of the line that a place means.
fn bytes(place: &Place) -> std::ops::Range<usize> {
    let offset =
        |characters: usize| place.text.char_indices().nth(characters).map_or(place.text.len(), |(offset, _)| offset);
    let first = (place.column as usize).saturating_sub(1);
    offset(first)..offset(first + place.length as usize)
}
