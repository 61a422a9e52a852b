//! The maps of all runs beside each other.
//!
//! **Input** the group. **Output** a square for each run with its label and what is wrong with it. With one tick all squares
//! take one scale: a smaller map becomes smaller, by style alone.

use maud::{Markup, html};

use super::{Group, GroupOutcome};
use crate::length::number;
use crate::page::{absent, png_address};

pub(super) fn body(group: &Group<'_>) -> Markup {
    if group.runs.is_empty() {
        return absent("There is no run.");
    }
    let largest_mm = group.runs.iter().filter_map(|run| Some(run.mapped()?.side_mm)).fold(0.0, f64::max);
    html! {
        p.with-script {
            label for="filter-text" { "Show " }
            input #filter-text type="search" placeholder="labels with…" aria-label="labels with";
            " "
            select #filter-verdict aria-label="which runs" {
                option value="" { "all runs" }
                option value="certified" { "certified" }
                option value="crosses" { "with crossings" }
                option value="failed" { "without a map" }
                option value="far" { "with outliers" }
            }
            " " span #filter-count {}
        }
        div.maps-of-group {
            input #same-scale type="checkbox";
            label for="same-scale" { "one scale" }
            @if largest_mm > 0.0 { span.note { " the widest square shows " (number(largest_mm, 3)) " mm" } }
            div.sheet {
                @for run in 0..group.runs.len() { (square(group, run, largest_mm)) }
            }
        }
        p.note {
            "Colours: the radius of each branch against the mean radius of its own tree, blue thin, red thick. "
            "A ! marks runs with outliers."
        }
    }
}

fn square(group: &Group<'_>, run: usize, largest_mm: f64) -> Markup {
    let (GroupRunView { label, class, sign }, is_far) =
        (GroupRunView::of(group, run), !group.of_run(run).is_empty());
    html! {
        figure.square data-run=(run) {
            a.frame href={ "#run-" (run) } {
                @match &group.runs[run].outcome {
                    GroupOutcome::Mapped(mapped) => {
                        img src=(png_address(&mapped.thumbnail_png)) alt={ "map of " (label) }
                            style={ "--s:" (format!("{:.4}", mapped.side_mm / largest_mm)) };
                    }
                    GroupOutcome::Failed(failed) => { span.none { (failed.code) } }
                }
            }
            figcaption {
                span.(class) { (sign) } " " @if is_far { b.far { "! " } } (label)
            }
        }
    }
}

struct GroupRunView<'a> {
    label: &'a str,
    class: &'static str,
    sign: &'static str,
}

impl<'a> GroupRunView<'a> {
    fn of(group: &Group<'a>, run: usize) -> Self {
        let verdict = group.verdict(run);
        Self { label: &group.runs[run].label, class: verdict.class(), sign: verdict.sign() }
    }
}
