//! What a code means, printed.

use espalier_model::diagnose::Class;
use espalier_pipeline::explain::{Entry, catalogue, explain};

use crate::args::ExplainArguments;
use crate::progress;

/// Columns of text; the widest that is easily read.
const WIDTH: usize = 96;

/// Prints one code, or all.
pub(crate) fn print(arguments: &ExplainArguments, is_json: bool) -> anyhow::Result<()> {
    let Some(code) = &arguments.code else {
        let all = catalogue();
        progress::result(&if is_json { json(&all)? } else { list(&all) });
        return Ok(());
    };
    let entry = explain(code)?;
    progress::result(&if is_json { json(&entry)? } else { page(&entry) });
    Ok(())
}

fn json(what: &impl serde::Serialize) -> anyhow::Result<String> {
    Ok(serde_json::to_string_pretty(what)?)
}

fn page(entry: &Entry) -> String {
    let mut lines = vec![format!("{}: {}", entry.code, entry.title())];
    for class in Class::ALL.iter().filter(|class| entry.exit_codes().contains(&class.exit_code())) {
        lines.push(format!("exit code {}: {}", class.exit_code(), class.meaning()));
    }
    lines.push(String::new());
    lines.push(paragraph("cause    ", entry.cause()));
    lines.push(paragraph("way out  ", entry.way_out()));
    lines.extend(entry.example().map(|example| format!("example  {example}")));
    lines.join("\n")
}

/// Words in lines of [`WIDTH`], under a heading at their left.
pub(crate) fn paragraph(heading: &str, text: &str) -> String {
    let mut lines = vec![heading.to_owned()];
    for word in text.split_whitespace() {
        let line = lines.last().map_or(0, |line| line.chars().count());
        if line > heading.len() && line + 1 + word.chars().count() > WIDTH {
            lines.push(" ".repeat(heading.len()));
        }
        if let Some(line) = lines.last_mut() {
            let is_begun = line.chars().count() > heading.len();
            line.push_str(if is_begun { " " } else { "" });
            line.push_str(word);
        }
    }
    lines.join("\n")
}

fn list(all: &[Entry]) -> String {
    let width = all.iter().map(|entry| entry.code.len()).max().unwrap_or(0);
    let mut lines = Vec::new();
    let mut part = "";
    for entry in all {
        if entry.part != part {
            part = entry.part;
            lines.extend([String::new(), part.to_owned()]);
        }
        let exits: Vec<String> = entry.exit_codes().iter().map(u8::to_string).collect();
        lines.push(format!("  {:<width$}  {:>3}  {}", entry.code, exits.join(","), entry.title()));
    }
    lines.extend([String::new(), "The number is the exit code. espalier explain CODE says more.".to_owned()]);
    lines.join("\n").trim_start().to_owned()
}
