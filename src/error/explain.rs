//! A page for every code: what it means, a message of it, its causes and remedies. `risorius explain CODE` prints it.
//!
//! One Markdown file per letter in the folder `explain`: `# <letter>: <what it is about>`, then per code `## <code> <title>`,
//! the first line of a message as an indented block, text, and a list of remedies.

/// The files, in the order of a run.
const FAMILIES: [&str; 7] = [
    include_str!("explain/C.md"),
    include_str!("explain/M.md"),
    include_str!("explain/K.md"),
    include_str!("explain/G.md"),
    include_str!("explain/S.md"),
    include_str!("explain/F.md"),
    include_str!("explain/O.md"),
];

/// All codes of a letter.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Family {
    /// Letter and subject, for example `S: the solver`.
    pub title: &'static str,
    /// Its pages, by code.
    pub pages: Vec<Page>,
}

/// What there is to say about a code.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Page {
    /// The code, for example `S003`.
    pub code: &'static str,
    /// What happened, in a few words.
    pub title: &'static str,
    /// Message, cause, remedies: Markdown without the heading.
    pub text: &'static str,
}

/// Every code by family.
pub fn families() -> Vec<Family> {
    let family = |text: &'static str| {
        let mut sections = text.split("\n## ");
        let title = sections.next().unwrap_or_default().trim_start_matches("# ").trim();
        Family { title, pages: sections.map(page_of).collect() }
    };
    FAMILIES.into_iter().map(family).collect()
}

/// Every page.
pub fn pages() -> impl Iterator<Item = Page> {
    families().into_iter().flat_map(|family| family.pages)
}

/// The page of a code, in capitals or not.
///
/// # Errors
/// The code that is nearest in spelling.
pub fn page(code: &str) -> std::result::Result<Page, Option<&'static str>> {
    let code = code.trim().to_uppercase();
    let near = |page: &Page| (strsim::damerau_levenshtein(&code, page.code), page.code);
    pages().find(|page| page.code == code).ok_or_else(|| {
        pages().map(|page| near(&page)).min().filter(|(distance, _)| *distance <= 2).map(|(_, code)| code)
    })
}

fn page_of(section: &'static str) -> Page {
    let (heading, text) = section.split_once('\n').unwrap_or((section, ""));
    let (code, title) = heading.split_once(' ').unwrap_or((heading, ""));
    Page { code, title, text: text.trim_matches('\n') }
}
