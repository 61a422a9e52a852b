//! What a command has come to, printed: for people its tables, files and digest, for programs one JSON object.
//!
//! **Guarantees** standard output of a command that was told `--json` is one JSON text: no table, no other line.
//! Only `completions` prints its script and `config init` its TOML all the same.

use espalier_pipeline::{Plan, Reason, Summary};
use serde_json::{Value, json};

use crate::progress;

const SUMMARY_FORMAT: &str = "espalier-summary";
const PLAN_FORMAT: &str = "espalier-plan";
const VERSION: u32 = 1;

/// Prints the files that say most, and the digest.
pub(crate) fn print(summary: &Summary, is_json: bool) {
    if is_json {
        return print_json(of(summary));
    }
    files(summary).iter().for_each(|file| progress::result(file));
    progress::result(&format!("digest {}", summary.digest));
}

/// Prints a table for people; a program has the files.
pub(crate) fn table(table: &str, is_json: bool) {
    if !is_json {
        progress::result(table);
    }
}

/// The parts of a summary.
pub(crate) fn of(summary: &Summary) -> serde_json::Map<String, Value> {
    let folder = summary.out.display().to_string();
    let parts = [
        ("folder", folder.into()),
        ("files", files(summary).into()),
        ("digest", summary.digest.clone().into()),
    ];
    parts.into_iter().map(|(name, value): (&str, Value)| (name.to_owned(), value)).collect()
}

/// Prints parts of a summary with its format.
pub(crate) fn print_json(mut parts: serde_json::Map<String, Value>) {
    parts.insert("format".to_owned(), SUMMARY_FORMAT.into());
    parts.insert("version".to_owned(), VERSION.into());
    progress::result(&text(&Value::Object(parts)));
}

fn files(summary: &Summary) -> Vec<String> {
    summary.highlights.iter().map(|file| summary.out.join(file).display().to_string()).collect()
}

/// What a run would do, as JSON.
pub(crate) fn plan(plans: &[Plan]) -> String {
    let stage = |plan: &Plan| {
        let action = match &plan.reason {
            None => "keep",
            Some(Reason::After { .. }) => "do if that changes",
            Some(_) if plan.is_shared => "copy",
            Some(_) => "do",
        };
        json!({
            "stage": plan.stage.name(),
            "action": action,
            "reason": plan.reason.as_ref().map(ToString::to_string),
            "cpu_seconds": plan.cost.map(|cost| cost.cpu_seconds),
            "peak_bytes": plan.cost.map(|cost| cost.bytes),
        })
    };
    let stages: Vec<Value> = plans.iter().map(stage).collect();
    text(&json!({ "format": PLAN_FORMAT, "version": VERSION, "stages": stages }))
}

/// A table of tabs as JSON: an object a row, by the names of its columns.
pub(crate) fn rows(table: &str) -> String {
    let mut lines = table.lines();
    let heads: Vec<&str> = lines.next().unwrap_or_default().split('\t').collect();
    let row = |line: &str| {
        let cells = heads.iter().zip(line.split('\t'));
        Value::Object(cells.map(|(head, cell)| ((*head).to_owned(), value(cell))).collect())
    };
    text(&Value::Array(lines.map(row).collect()))
}

/// A cell: a number, nothing, or a text.
fn value(cell: &str) -> Value {
    let whole = || cell.parse::<i64>().ok().map(Value::from);
    let number = || cell.parse::<f64>().ok().and_then(serde_json::Number::from_f64).map(Value::Number);
    if cell == "n/a" { Value::Null } else { whole().or_else(number).unwrap_or_else(|| cell.into()) }
}

fn text(value: &Value) -> String {
    // A value of JSON: serialisation cannot fail.
    serde_json::to_string_pretty(value).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_are_numbers_where_they_are() {
        let text = rows("branch\tradius_mm\tnote\n3\t1.50\tn/a\n4\tn/a\tnarrow\n");
        let rows: Value = serde_json::from_str(&text).expect("JSON");
        let expected = json!([
            { "branch": 3, "radius_mm": 1.5, "note": null },
            { "branch": 4, "radius_mm": null, "note": "narrow" },
        ]);
        assert_eq!(rows, expected);
    }
}
