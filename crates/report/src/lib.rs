//! The page of a run: one file of HTML that says what was found, how, and how well.
//!
//! | step | file | what |
//! |--:|---|---|
//! | 1 | `facts`, `rows` | what the caller hands in: values, tables, pictures as bytes |
//! | 2 | `losses`, `length`, `layout`, `strokes` | what each node loses, units, places on the page, lines |
//! | 3 | `panels`, `slices`, `outline`, `shadow` | slices of the scan and projections of the mask |
//! | 4 | `verdict` … `provenance` | one section a file, in the order in which they are read |
//! | 5 | `methods` | what was done, in sentences, with its citations |
//! | 6 | `page` | the frame that holds them: head, style, script |
//! | 7 | [`group`](mod@group) | one page over many runs |
//!
//! **Input** [`Facts`]. **Output** [`Made`]: `report.html`, `methods.md`, `references.bib`.
//! **Guarantees** the page asks for nothing outside of itself; every text is escaped where it is put in; the same facts
//! give the same bytes; without scripts everything is there but pan, zoom, the values under the pointer and sorting.
//! **Cost** O(nodes × methods); the size of the page is bounded by budgets at the top of each file.

mod facts;
mod params;
mod rows;

mod layout;
mod length;
mod losses;
mod strokes;

mod outline;
mod panels;
mod shadow;
mod slices;

mod branches;
mod colorings;
mod flicker;
mod input;
mod map;
mod plots;
mod profile;
mod projections;
mod provenance;
mod space;
mod verdict;
mod worst;

mod bibliography;
mod methods;

pub mod group;
pub mod page;

use espalier_model::Report;
use maud::{Markup, html};

pub use facts::{Coloring, Facts, InputFile, InputKind, Setting, StageFacts};
pub use params::Params;
pub use rows::Rows;
pub use slices::{Mosaic, Slices};

use page::{Page, Section};

/// What is written beside the results of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct Made {
    /// The page.
    pub html: String,
    /// What was done, as Markdown.
    pub methods: String,
    /// What that cites, as BibTeX.
    pub references: String,
    /// Sizes.
    pub report: Report,
}

/// Why a page cannot be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// Facts that are not of one tree.
    #[error("{what} has {n_entries} entries, the tree {n_nodes} nodes")]
    Mismatch {
        /// What does not fit.
        what: &'static str,
        /// How many entries it has.
        n_entries: usize,
        /// How many nodes the tree has.
        n_nodes: usize,
    },
    /// A picture that cannot be packed.
    #[error("a picture for the page cannot be packed: {0}")]
    Picture(#[from] image::ImageError),
}

impl espalier_model::Diagnose for Error {
    fn code(&self) -> &'static str {
        match self {
            Self::Mismatch { .. } => "E-REPORT-MISMATCH",
            Self::Picture(_) => "E-REPORT-PICTURE",
        }
    }

    fn class(&self) -> espalier_model::diagnose::Class {
        espalier_model::diagnose::Class::Internal
    }
}

/// Makes the page of a run.
///
/// # Errors
/// [`Error`] if facts are not of one tree, or a picture cannot be packed.
pub fn report(facts: &Facts<'_>, params: &Params) -> Result<Made, Error> {
    check_entries(facts)?;
    let written = methods::write(facts);
    let title = facts.title(params);
    let sections = sections(facts, params, &written)?;
    let html = Page {
        title: &title,
        lead: verdict::lead(facts),
        sections,
        scripts: &[page::TABLE_JS, page::MAP_JS, page::PROFILE_JS],
    }
    .into_html();
    let mut report = Report::default();
    report.count_usize("page_bytes", html.len());
    Ok(Made { html, methods: written.markdown, references: written.bibtex, report })
}

fn sections(facts: &Facts<'_>, params: &Params, written: &methods::Written) -> Result<Vec<Section>, Error> {
    let section = |id, title, body: Markup| Section { id, title, body };
    Ok(vec![
        section("verdict", "Verdict", verdict::body(facts)),
        section("input", "Input", input::body(facts)?),
        section("tree", "Tree in space", projections::body(facts)?),
        section("map", "Planar map", map::body(facts)),
        section("methods-compared", "Beside other methods", flicker::body(facts)),
        section("worst", "Where most is lost", worst::body(facts)),
        section("branches", "Branches", branches::body(facts, params)),
        section("generations", "By generation", plots::body(facts)),
        section("profile", "Calibre on the way to a tip", profile::body(facts)),
        section("methods", "Methods", html! { (written.html) }),
        section("provenance", "Provenance", provenance::body(facts)),
    ])
}

/// One entry per node.
fn check_entries(facts: &Facts<'_>) -> Result<(), Error> {
    let n_nodes = facts.tree.n_nodes();
    let layouts = facts.comparison.iter().flat_map(|comparison| &comparison.layouts);
    let entries = [("the embedding", facts.embedding.positions_mm.len())]
        .into_iter()
        .chain(layouts.map(|layout| ("a layout", layout.positions_mm.len())))
        .chain(facts.colorings.iter().map(|coloring| ("a colouring", coloring.bins.len())));
    for (what, n_entries) in entries {
        if n_entries != n_nodes {
            return Err(Error::Mismatch { what, n_entries, n_nodes });
        }
    }
    Ok(())
}
