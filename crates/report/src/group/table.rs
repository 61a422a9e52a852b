//! The runs with their numbers.
//!
//! **Input** the group. **Output** a table that can be sorted and filtered; outliers say what the group has.

use maud::{Markup, html};

use super::measures::{MEASURES, N_VOXEL};
use super::{Group, Outlier};
use crate::length::number;
use crate::page::absent;

/// Runs of the same input that are named in a cell.
const MOST_NAMED: usize = 3;

pub(super) fn body(group: &Group<'_>) -> Markup {
    if group.runs.is_empty() {
        return absent("There is no run.");
    }
    let shown = &MEASURES[..MEASURES.len() - N_VOXEL];
    html! {
        p.note {
            "Outliers are marked; what the group has stands in their hint and below. "
            span.with-script { "A click on a heading sorts. " }
            "group.tsv has the same with more digits, dictionary.tsv says what each column means."
        }
        div.scroll {
            table.sortable.runs {
                thead {
                    tr {
                        th scope="col" { "run" }
                        th scope="col" { "verdict" }
                        @for measure in shown { th.n scope="col" title=(measure.column.meaning) { (measure.heading) } }
                        th.n scope="col" title="size of a voxel of the mask: right, front, up" { "voxel (mm)" }
                        th scope="col" title="other runs of the same input" { "equal to" }
                    }
                }
                tbody { @for run in 0..group.runs.len() { (row(group, run)) } }
            }
        }
    }
}

fn row(group: &Group<'_>, run: usize) -> Markup {
    let verdict = group.verdict(run);
    let far = group.of_run(run);
    let state = if far.is_empty() { verdict.name().to_owned() } else { format!("{} far", verdict.name()) };
    let of = |index: usize| far.iter().find(|outlier| outlier.measure == index);
    let n_shown = MEASURES.len() - N_VOXEL;
    let others = group.same_as(run);
    let mut named: Vec<&str> =
        others.iter().take(MOST_NAMED).map(|&other| group.runs[other].label.as_str()).collect();
    let more = format!("{} more", others.len().saturating_sub(MOST_NAMED));
    named.extend((others.len() > MOST_NAMED).then_some(more.as_str()));
    html! {
        tr id={ "run-" (run) } data-run=(run) data-state=(state) data-label=(group.runs[run].label.to_lowercase()) {
            td { (group.runs[run].label) }
            td { span.(verdict.class()) { (verdict.sign()) } " " (verdict.name()) }
            @if let Some(mapped) = group.runs[run].mapped() {
                @for (index, measure) in MEASURES[..n_shown].iter().enumerate() {
                    (cell(group, &measure.text((measure.of)(&mapped.measured)), of(index)))
                }
                (cell(group, &voxel(mapped.measured.voxel_mm), (n_shown..MEASURES.len()).find_map(of)))
            } @else {
                @for _ in 0..=n_shown { td.n { "–" } }
            }
            td { (named.join(", ")) }
        }
    }
}

fn cell(group: &Group<'_>, text: &str, outlier: Option<&Outlier>) -> Markup {
    html! {
        @if let Some(outlier) = outlier { td.n.far title=(why(group, outlier)) { (text) } }
        @else { td.n { (text) } }
    }
}

/// What the group has, and by how much a value is off.
pub(super) fn why(group: &Group<'_>, outlier: &Outlier) -> String {
    let spread = &group.spreads[outlier.measure];
    let [low, high] = spread.limits();
    let measure = &MEASURES[outlier.measure];
    format!(
        "{}: {} spreads {} the median {}; limits {} and {}",
        measure.column.name,
        number(outlier.excess.abs(), 3),
        if outlier.excess > 0.0 { "above" } else { "below" },
        measure.text(spread.median),
        measure.text(low),
        measure.text(high)
    )
}

/// Three sizes, or one where they are equal.
fn voxel(size_mm: [f64; 3]) -> String {
    let texts = size_mm.map(|size| number(size, 3));
    if texts.iter().all(|text| *text == texts[0]) { texts[0].clone() } else { texts.join(" × ") }
}
