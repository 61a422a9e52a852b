//! What stands out, what has failed, which inputs are equal, which settings differ.
//!
//! **Input** the group. **Output** tables, or a line where there is nothing to list.

use std::collections::BTreeMap;

use maud::{Markup, html};

use super::measures::MEASURES;
use super::outliers::{LEAST_RUNS, LIMIT};
use super::{Group, GroupOutcome, files};
use crate::length::{counted, number};
use crate::page::{Head, table};

/// Settings on the page.
const MOST_SETTINGS: usize = 60;
/// Runs that are named beside a value.
const MOST_NAMED: usize = 6;

pub(super) fn outliers(group: &Group<'_>) -> Markup {
    if group.n_mapped() < LEAST_RUNS {
        return html! {
            p { (counted(group.n_mapped(), "run with a map is", "runs with a map are")) " too few to say what is usual: nothing is called an outlier below " (LEAST_RUNS) "." }
        };
    }
    let heads = heads(&[
        ("run", false),
        ("measure", false),
        ("value", true),
        ("median", true),
        ("spreads off", true),
        ("limits", false),
    ]);
    let row = |outlier: &super::Outlier| {
        let spread = &group.spreads[outlier.measure];
        let measure = &MEASURES[outlier.measure];
        let [low, high] = spread.limits().map(|limit| measure.text(limit));
        vec![
            html! { a href={ "#run-" (outlier.run) } { (group.runs[outlier.run].label) } },
            html! { (measure.column.name) },
            html! { (measure.text(outlier.value)) },
            html! { (measure.text(spread.median)) },
            html! { (number(outlier.excess, 3)) },
            html! { (low) " to " (high) },
        ]
    };
    let rows: Vec<Vec<Markup>> = group.outliers.iter().map(row).collect();
    html! {
        p.note {
            "Values outside of the median ± " (LIMIT) " spreads; a spread is 1.4826 times the median absolute deviation, or where more than half of the values are equal, 1.2533 times the mean one. An outlier is a run to look at, not an error."
        }
        @if rows.is_empty() { p { "None." } } @else { (table("sortable", &heads, &rows)) }
    }
}

pub(super) fn failures(group: &Group<'_>) -> Markup {
    let heads = heads(&[
        ("run", false),
        ("code", false),
        ("why", false),
        ("done up to", false),
        ("to try again", false),
    ]);
    let rows: Vec<Vec<Markup>> = group
        .runs
        .iter()
        .enumerate()
        .filter_map(|(idx, run)| match &run.outcome {
            GroupOutcome::Mapped(_) => None,
            GroupOutcome::Failed(failed) => Some(vec![
                html! { a href={ "#run-" (idx) } { (run.label) } },
                html! { code { (failed.code) } },
                html! { (failed.reason) },
                html! { (failed.done_to.as_deref().unwrap_or("–")) },
                html! { @if let Some(retry) = &failed.retry { code { (retry) } } @else { "–" } },
            ]),
        })
        .collect();
    if rows.is_empty() {
        return html! { p { "None: every run has a map." } };
    }
    html! {
        p.note { "Commands start from the folder that their paths start from." }
        (table("failures", &heads, &rows))
    }
}

pub(super) fn equal(group: &Group<'_>) -> Markup {
    if group.equal.is_empty() {
        return html! { p { "None: no two runs have the same input." } };
    }
    html! {
        p.note { "These runs were made from files of the same content, or where a run has none, have the same tree: they are no independent cases." }
        ul.equal {
            @for runs in &group.equal {
                li {
                    @for (nth, &run) in runs.iter().enumerate() {
                        @if nth > 0 { ", " }
                        a href={ "#run-" (run) } { (group.runs[run].label) }
                    }
                }
            }
        }
    }
}

pub(super) fn settings(group: &Group<'_>) -> Markup {
    let mut values: BTreeMap<&str, BTreeMap<&str, Vec<usize>>> = BTreeMap::new();
    for (idx, run) in group.runs.iter().enumerate() {
        for (key, value) in run.mapped().into_iter().flat_map(|mapped| &mapped.settings) {
            values.entry(key).or_default().entry(value).or_default().push(idx);
        }
    }
    values.retain(|_, values| values.len() > 1);
    if values.is_empty() {
        return html! { p { "None: all runs with a map have the same settings." } };
    }
    let n_keys = values.len();
    let heads = heads(&[("setting", false), ("values", false)]);
    let rows = values.into_iter().take(MOST_SETTINGS).map(|(key, values)| {
        let mut values: Vec<(&str, Vec<usize>)> = values.into_iter().collect();
        values.sort_by_key(|(_, runs)| std::cmp::Reverse(runs.len()));
        let cell = html! {
            @for (nth, (value, runs)) in values.iter().take(MOST_NAMED).enumerate() {
                @if nth > 0 { "; " }
                code { (value) } " " (named(group, runs))
            }
            @if values.len() > MOST_NAMED { "; and " (values.len() - MOST_NAMED) " more" }
        };
        vec![html! { code { (key) } }, cell]
    });
    let rows: Vec<Vec<Markup>> = rows.collect();
    html! {
        p.note {
            "Numbers of runs with other settings do not compare at once."
            @if n_keys > MOST_SETTINGS { " The first " (MOST_SETTINGS) " of " (n_keys) "." }
        }
        (table("settings", &heads, &rows))
    }
}

/// A few runs by label, many by their number.
fn named(group: &Group<'_>, runs: &[usize]) -> String {
    if runs.len() > MOST_NAMED {
        return format!("({} runs)", runs.len());
    }
    let labels: Vec<&str> = runs.iter().map(|&run| group.runs[run].label.as_str()).collect();
    format!("({})", labels.join(", "))
}

/// The columns of `group.tsv`.
pub(super) fn columns() -> Markup {
    let heads = heads(&[("column", false), ("unit", false), ("meaning", false)]);
    let rows: Vec<Vec<Markup>> = files::columns()
        .iter()
        .map(|column| {
            vec![html! { code { (column.name) } }, html! { (column.unit) }, html! { (column.meaning) }]
        })
        .collect();
    html! { details { summary { "The columns of group.tsv" } (table("settings", &heads, &rows)) } }
}

fn heads<'a>(names: &[(&'a str, bool)]) -> Vec<Head<'a>> {
    names.iter().map(|&(name, is_number)| Head { name, meaning: "", is_number }).collect()
}
