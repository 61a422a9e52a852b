//! How the results came about: program, inputs by digest, seed, settings that differ, and what the columns mean.
//!
//! **Guarantees** no time, no memory, no machine, no path, no name of a file: those are in `provenance/` or nowhere.

use maud::{Markup, html};

use crate::facts::{Facts, Setting};
use crate::page::{Head, absent, table};

pub(crate) fn body(facts: &Facts<'_>) -> Markup {
    let (changed, kept): (Vec<&Setting>, Vec<&Setting>) =
        facts.settings.iter().partition(|setting| setting.is_changed());
    html! {
        dl.facts {
            div { dt { "Program" } dd { (facts.program) } }
            div { dt { "Seed" } dd { (facts.seed) } }
            div { dt { "Tree" } dd { code { (facts.tree.digest()) } } }
            div { dt { "Results" } dd { code { (facts.results_sha256) } } }
        }
        p.note { "Results is the SHA-256 over the lines of SHA256SUMS for every result but this page and provenance: equal for equal results. Times and memory are in provenance/timings.tsv, since they differ from run to run." }
        (inputs(facts))
        h3 { "Settings that differ from the defaults" }
        @if changed.is_empty() { p { "None." } }
        @else { (settings_table(&changed)) }
        details {
            summary { "All other settings (" (kept.len()) ")" }
            (settings_table(&kept))
        }
        (stages(facts))
        (dictionary(facts))
    }
}

fn inputs(facts: &Facts<'_>) -> Markup {
    if facts.input_files.is_empty() {
        return absent(
            "No file went into this run: it made its input itself, or began with files of other runs.",
        );
    }
    /// Rows: a series of slices has hundreds.
    const MAX_ROWS: usize = 12;
    let head = |name, is_number| Head { name, meaning: "", is_number };
    let rows: Vec<Vec<Markup>> = facts
        .input_files
        .iter()
        .take(MAX_ROWS)
        .map(|file| vec![html! { (file.role) }, html! { (file.n_bytes) }, html! { code { (file.sha256) } }])
        .collect();
    html! {
        h3 { "Inputs" }
        p.note { "By content: names of files may be those of patients and are nowhere on this page." }
        (table("", &[head("role", false), head("bytes", true), head("SHA-256", false)], &rows))
        @if facts.input_files.len() > MAX_ROWS {
            p.note { "The first " (MAX_ROWS) " of " (facts.input_files.len()) "; provenance/inputs.tsv has all." }
        }
    }
}

fn settings_table(settings: &[&Setting]) -> Markup {
    let head = |name| Head { name, meaning: "", is_number: false };
    let rows: Vec<Vec<Markup>> = settings
        .iter()
        .map(|setting| {
            let default = setting.default.as_deref().unwrap_or("not set");
            vec![html! { code { (setting.key) } }, html! { (setting.value) }, html! { (default) }]
        })
        .collect();
    table("settings", &[head("key"), head("value"), head("default")], &rows)
}

fn stages(facts: &Facts<'_>) -> Markup {
    html! {
        details {
            summary { "What each stage counted" }
            @for stage in &facts.stages {
                h4 { (stage.stage) }
                dl.counts {
                    @for (name, value) in &stage.counts {
                        div { dt { (name.replace('_', " ")) } dd { (crate::length::number(*value, 6)) } }
                    }
                }
            }
        }
    }
}

fn dictionary(facts: &Facts<'_>) -> Markup {
    let Some(rows) = &facts.dictionary else { return html! {} };
    let head = |name| Head { name, meaning: "", is_number: false };
    let cells: Vec<Vec<Markup>> =
        rows.rows().iter().map(|row| row.iter().map(|cell| html! { (cell) }).collect()).collect();
    html! {
        details {
            summary { "Data dictionary: what the columns of the tables mean" }
            (table("dictionary", &[head("table"), head("column"), head("unit"), head("meaning")], &cells))
        }
    }
}
