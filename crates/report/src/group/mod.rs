//! One page over many runs: their maps, their numbers, which of them stand out, which have failed.
//!
//! | step | file | what |
//! |--:|---|---|
//! | 1 | `measures` | the numbers of a run, with their columns |
//! | 2 | `outliers` | what lies far from the rest |
//! | 3 | `sheet`, `table`, `beads`, `lists` | the page: maps, table, distributions; outliers, failures, equal inputs, settings |
//! | 4 | `files` | `group.tsv`, `group.json`, `dictionary.tsv` |
//!
//! **Input** [`GroupRun`]s in the order in which they are shown, a label each. **Output** [`MadeGroup`].
//! **Guarantees** those of the page of a run: no request to anywhere, every text escaped, same bytes for same values;
//! nothing of a run but its label, its numbers and its picture.
//! **Cost** O(runs × measures), and the bytes of the pictures.

mod beads;
mod files;
mod lists;
mod measures;
mod outliers;
mod sheet;
mod table;

use std::collections::BTreeMap;

use maud::{Markup, PreEscaped, html};

use crate::length::counted;
use crate::page::{self, Page, Section};
use measures::{MEASURES, Measure};
use outliers::Spread;

pub use measures::Measured;

const GROUP_CSS: &str = include_str!("../page/group.css");
const GROUP_JS: &str = include_str!("../page/group.js");

/// A run of a group.
#[derive(Clone, Debug, PartialEq)]
pub struct GroupRun {
    /// What to call it: shown as it is.
    pub label: String,
    /// What it came to.
    pub outcome: GroupOutcome,
}

/// What a run came to.
#[derive(Clone, Debug, PartialEq)]
pub enum GroupOutcome {
    /// It has a map.
    Mapped(Box<Mapped>),
    /// It has none.
    Failed(Failed),
}

/// A run with a map.
#[derive(Clone, Debug, PartialEq)]
pub struct Mapped {
    /// Its numbers.
    pub measured: Measured,
    /// Its map as a small square, PNG.
    pub thumbnail_png: Vec<u8>,
    /// How many mm of the map the square is wide.
    pub side_mm: f64,
    /// The SHA-256 of each file that it was made from; none for a phantom.
    pub inputs: Vec<String>,
    /// The digest of its tree.
    pub tree: String,
    /// Its settings by dotted key, those of pictures and pages left out.
    pub settings: BTreeMap<String, String>,
}

/// A run without a map.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Failed {
    /// The code of the error.
    pub code: String,
    /// Why, without paths and names of files that are not ours.
    pub reason: String,
    /// The last stage whose results are there.
    pub done_to: Option<String>,
    /// The command that tries again, from the folder that the labels start from.
    pub retry: Option<String>,
}

/// The files of a group.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MadeGroup {
    /// The page.
    pub html: String,
    /// `group.tsv`.
    pub tsv: String,
    /// `group.json`.
    pub json: String,
    /// `dictionary.tsv`.
    pub dictionary: String,
    /// The sums, for a terminal.
    pub summary: String,
}

/// Makes the page of a group and its tables; `title` is the heading.
#[must_use]
pub fn group(title: &str, runs: &[GroupRun]) -> MadeGroup {
    let group = Group::new(runs);
    let section = |id, title, body: Markup| Section { id, title, body };
    let html = Page {
        title,
        lead: group.lead(),
        sections: vec![
            section("maps", "Maps", sheet::body(&group)),
            section("runs", "Runs", table::body(&group)),
            section("outliers", "Outliers", lists::outliers(&group)),
            section("failures", "Without a map", lists::failures(&group)),
            section("distributions", "Distributions", beads::body(&group)),
            section("equal", "Equal inputs", lists::equal(&group)),
            section("settings", "Settings that differ", lists::settings(&group)),
            section("columns", "Columns", lists::columns()),
        ],
        scripts: &[page::TABLE_JS, GROUP_JS],
    }
    .into_html();
    MadeGroup {
        html,
        tsv: files::tsv(&group),
        json: files::json(&group),
        dictionary: files::dictionary(),
        summary: group.counts().join(", "),
    }
}

/// How a run is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Verdict {
    Certified,
    Crosses,
    Failed,
}

impl Verdict {
    fn class(self) -> &'static str {
        if self == Self::Certified { "good" } else { "bad" }
    }

    fn sign(self) -> &'static str {
        if self == Self::Certified { "✓" } else { "✗" }
    }

    /// As it stands in the tables.
    fn name(self) -> &'static str {
        match self {
            Self::Certified => "certified",
            Self::Crosses => "crosses",
            Self::Failed => "failed",
        }
    }
}

/// A value that lies far from the rest.
struct Outlier {
    run: usize,
    measure: usize,
    value: f64,
    excess: f64,
}

/// The runs with what they have in common.
struct Group<'a> {
    runs: &'a [GroupRun],
    /// By measure.
    spreads: Vec<Spread>,
    /// By run, then by measure.
    outliers: Vec<Outlier>,
    /// Runs of the same input, at least two each.
    equal: Vec<Vec<usize>>,
}

impl<'a> Group<'a> {
    fn new(runs: &'a [GroupRun]) -> Self {
        let value = |run: &GroupRun, measure: &Measure| {
            run.mapped().map_or(f64::NAN, |mapped| (measure.of)(&mapped.measured))
        };
        let spread = |measure: &Measure| {
            Spread::of(&runs.iter().map(|run| value(run, measure)).collect::<Vec<_>>(), measure.noise())
        };
        let spreads: Vec<Spread> = MEASURES.iter().map(spread).collect();
        let mut outliers = Vec::new();
        for (run_idx, run) in runs.iter().enumerate() {
            for (idx, (measure, spread)) in MEASURES.iter().zip(&spreads).enumerate() {
                let value = value(run, measure);
                if let Some(excess) = spread.excess(value) {
                    outliers.push(Outlier { run: run_idx, measure: idx, value, excess });
                }
            }
        }
        Self { runs, spreads, outliers, equal: equal(runs) }
    }

    fn verdict(&self, run: usize) -> Verdict {
        match self.runs[run].mapped() {
            None => Verdict::Failed,
            Some(mapped) if mapped.measured.crossings > 0 => Verdict::Crosses,
            Some(_) => Verdict::Certified,
        }
    }

    /// The outliers of a run.
    fn of_run(&self, run: usize) -> &[Outlier] {
        let from = self.outliers.partition_point(|outlier| outlier.run < run);
        let to = self.outliers.partition_point(|outlier| outlier.run <= run);
        &self.outliers[from..to]
    }

    /// The other runs of the same input.
    fn same_as(&self, run: usize) -> Vec<usize> {
        let own = self.equal.iter().find(|runs| runs.contains(&run));
        own.map(|runs| runs.iter().copied().filter(|other| *other != run).collect()).unwrap_or_default()
    }

    /// The first run of the same input, where several have it.
    fn first_equal(&self, run: usize) -> Option<usize> {
        self.equal.iter().find(|runs| runs.contains(&run)).and_then(|runs| runs.first().copied())
    }

    /// Runs with a map.
    fn n_mapped(&self) -> usize {
        self.runs.iter().filter(|run| run.mapped().is_some()).count()
    }

    fn counts(&self) -> Vec<String> {
        let n_of = |verdict| (0..self.runs.len()).filter(|&run| self.verdict(run) == verdict).count();
        let n_far = (0..self.runs.len()).filter(|&run| !self.of_run(run).is_empty()).count();
        let mut counts =
            vec![counted(self.runs.len(), "run", "runs"), format!("{} certified", n_of(Verdict::Certified))];
        for (n, what) in [
            (n_of(Verdict::Crosses), "with crossings"),
            (n_of(Verdict::Failed), "without a map"),
            (n_far, "with outliers"),
            (self.equal.iter().map(Vec::len).sum(), "of equal inputs"),
        ] {
            if n > 0 {
                counts.push(format!("{n} {what}"));
            }
        }
        counts
    }

    fn lead(&self) -> Markup {
        let is_good = (0..self.runs.len()).all(|run| self.verdict(run) == Verdict::Certified);
        html! {
            style { (PreEscaped(GROUP_CSS)) }
            p.verdict.(if is_good { "good" } else { "bad" }) {
                (if is_good { "✓ " } else { "✗ " }) (self.counts().join(", ")) "."
            }
            p.caution { "For research use only." }
        }
    }
}

impl GroupRun {
    fn mapped(&self) -> Option<&Mapped> {
        match &self.outcome {
            GroupOutcome::Mapped(mapped) => Some(mapped),
            GroupOutcome::Failed(_) => None,
        }
    }

    /// What tells its input from another: the digests of the files that it was made from, or where there are none, of its
    /// tree.
    fn origin(&self) -> Option<Vec<String>> {
        let mapped = self.mapped()?;
        let mut origin = mapped.inputs.clone();
        origin.sort_unstable();
        Some(if origin.is_empty() { vec![mapped.tree.clone()] } else { origin })
    }
}

/// Runs of the same input, at least two each, in the order of the first.
fn equal(runs: &[GroupRun]) -> Vec<Vec<usize>> {
    let mut by_origin: BTreeMap<Vec<String>, Vec<usize>> = BTreeMap::new();
    for (idx, run) in runs.iter().enumerate() {
        if let Some(origin) = run.origin() {
            by_origin.entry(origin).or_default().push(idx);
        }
    }
    let mut equal: Vec<Vec<usize>> = by_origin.into_values().filter(|runs| runs.len() > 1).collect();
    equal.sort();
    equal
}

#[cfg(test)]
mod tests;
