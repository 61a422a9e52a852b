//! The group as tables for other programs.
//!
//! **Input** the group. **Output** `group.tsv`, `group.json` (format `espalier-group` version 1), `dictionary.tsv`.

use espalier_model::table::{Column, Table};
use serde_json::{Map, Value, json};

use super::measures::MEASURES;
use super::{Group, GroupOutcome, Verdict};

const FORMAT: &str = "espalier-group";
const VERSION: u32 = 1;

const FIRST: [Column; 4] = [
    Column::new("run", "n/a", "label of the run"),
    Column::new(
        "verdict",
        "n/a",
        "certified: a map without crossings; crosses: a map with crossings; failed: no map",
    ),
    Column::new("code", "n/a", "code of the error of a run without a map"),
    Column::new("done_to", "n/a", "the last stage whose results a run without a map has"),
];
const LAST: [Column; 4] = [
    Column::new(
        "outliers",
        "n/a",
        "the columns in which the run lies outside of the median ± 3.5 spreads, with commas between",
    ),
    Column::new(
        "equal_to",
        "n/a",
        "the first run of the same input, where several have it; n/a for a run that is alone",
    ),
    Column::new(
        "input_sha256",
        "n/a",
        "the SHA-256 of the files that the run was made from, with commas between",
    ),
    Column::new("tree", "n/a", "the digest of its tree"),
];

/// The columns of `group.tsv`.
pub(super) fn columns() -> Vec<Column> {
    FIRST.into_iter().chain(MEASURES.iter().map(|measure| measure.column)).chain(LAST).collect()
}

pub(super) fn dictionary() -> String {
    espalier_model::table::dictionary(&[("group.tsv", &columns())])
}

pub(super) fn tsv(group: &Group<'_>) -> String {
    let mut table = Table::with(&columns());
    for (idx, run) in group.runs.iter().enumerate() {
        let none = || "n/a".to_owned();
        let failed = match &run.outcome {
            GroupOutcome::Failed(failed) => Some(failed),
            GroupOutcome::Mapped(_) => None,
        };
        let mut cells = vec![
            run.label.clone(),
            group.verdict(idx).name().to_owned(),
            failed.map_or_else(none, |failed| failed.code.clone()),
            failed.and_then(|failed| failed.done_to.clone()).unwrap_or_else(none),
        ];
        let value = |measure: &super::Measure| {
            let mapped = run.mapped()?;
            Some(measure.digits.text((measure.of)(&mapped.measured)))
        };
        cells.extend(MEASURES.iter().map(|measure| value(measure).unwrap_or_else(none)));
        let joined = |parts: Vec<&str>| if parts.is_empty() { none() } else { parts.join(",") };
        let far = group.of_run(idx).iter().map(|outlier| MEASURES[outlier.measure].column.name);
        cells.push(joined(far.collect()));
        cells.push(group.first_equal(idx).map_or_else(none, |first| group.runs[first].label.clone()));
        let inputs = run.mapped().into_iter().flat_map(|mapped| &mapped.inputs);
        cells.push(joined(inputs.map(String::as_str).collect()));
        cells.push(run.mapped().map_or_else(none, |mapped| mapped.tree.clone()));
        table.row_of(&cells);
    }
    table.into_string()
}

pub(super) fn json(group: &Group<'_>) -> String {
    let measures: Vec<Value> = MEASURES
        .iter()
        .zip(&group.spreads)
        .map(|(measure, spread)| {
            let [low, high] = spread.limits();
            json!({
                "name": measure.column.name, "unit": measure.column.unit, "n": spread.n,
                "median": spread.median, "spread": spread.spread, "low_limit": low, "high_limit": high,
            })
        })
        .collect();
    let record = json!({
        "format": FORMAT,
        "version": VERSION,
        "measures": measures,
        "runs": (0..group.runs.len()).map(|run| run_record(group, run)).collect::<Vec<_>>(),
    });
    serde_json::to_string_pretty(&record).unwrap_or_default() + "\n"
}

fn run_record(group: &Group<'_>, idx: usize) -> Value {
    let run = &group.runs[idx];
    let verdict = group.verdict(idx);
    match &run.outcome {
        GroupOutcome::Failed(failed) => json!({
            "run": run.label, "verdict": verdict.name(), "code": failed.code, "reason": failed.reason,
            "done_to": failed.done_to, "retry": failed.retry,
        }),
        GroupOutcome::Mapped(mapped) => {
            let values: Map<String, Value> = MEASURES
                .iter()
                .map(|measure| (measure.column.name.to_owned(), (measure.of)(&mapped.measured).into()))
                .collect();
            let far: Vec<Value> = group
                .of_run(idx)
                .iter()
                .map(|outlier| json!({ "name": MEASURES[outlier.measure].column.name, "spreads_off": outlier.excess }))
                .collect();
            let equal = group.first_equal(idx).map(|first| group.runs[first].label.as_str());
            json!({
                "run": run.label, "verdict": verdict.name(), "is_certified": verdict == Verdict::Certified,
                "values": values, "outliers": far, "equal_to": equal, "input_sha256": mapped.inputs,
                "tree": mapped.tree,
            })
        }
    }
}
