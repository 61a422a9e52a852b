//! Runs the whole pipeline on degenerate traced trees at full size; one line for each: seconds by stage, verdict.
//!
//! `cargo run --release -p espalier-tests --example degenerate -- [SHARE] [NAME]`
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a program")]

use std::fs;
use std::path::Path;
use std::process::ExitCode;

use espalier_model::Diagnose;
use espalier_model::diagnose::Class;
use espalier_pipeline::Error;
use espalier_tests::degenerate::cases;
use espalier_tests::{results, run, set};

const FOLDER: &str = "target/degenerate";
const STAGES: [&str; 4] = ["tree", "views", "embed", "render"];

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let share = arguments.first().and_then(|share| share.parse().ok()).unwrap_or(1.0);
    let wanted = arguments.get(1);
    println!("case\tnodes\t{}\ttotal\tverdict", STAGES.join("\t"));
    for (name, swc) in cases(share) {
        if wanted.is_some_and(|wanted| !name.contains(wanted.as_str())) {
            continue;
        }
        if let Err(error) = report(name, &swc) {
            eprintln!("error: {name}: {error}");
            return ExitCode::FAILURE;
        }
    }
    ExitCode::SUCCESS
}

/// Runs a case and prints its line; a refusal is a verdict.
fn report(name: &str, swc: &str) -> std::io::Result<()> {
    let folder = Path::new(FOLDER).join(name.replace([' ', ','], "-"));
    fs::create_dir_all(&folder)?;
    let folder = fs::canonicalize(folder)?;
    let file = folder.join("traced.swc");
    fs::write(&file, swc)?;
    let out = folder.join("run");
    let refused = run(&file, &out, &[set("input.unit", "mm")], 2).err();
    if let Some(error) = refused.as_ref().filter(|error| error.class() == Class::Io) {
        return Err(std::io::Error::other(error.to_string()));
    }
    let seconds = seconds(&out);
    let cells: Vec<String> =
        seconds.iter().map(|s| s.map_or_else(|| "n/a".to_owned(), |s| format!("{s:.2}"))).collect();
    let total = seconds.iter().flatten().fold(0.0, |sum, s| sum + s);
    println!("{name}\t{}\t{}\t{total:.2}\t{}", swc.lines().count(), cells.join("\t"), verdict(&out, refused));
    Ok(())
}

fn verdict(out: &Path, refused: Option<Error>) -> String {
    if let Some(error) = refused {
        return format!("refused: {error}");
    }
    let certificate = results(out).1.certificate;
    let word = if certificate.holds() { "certified" } else { "NOT PLANAR" };
    format!("{} crossings, {word}", certificate.crossings)
}

/// The seconds of each stage, from the run's own times.
fn seconds(out: &Path) -> [Option<f64>; 4] {
    let text = fs::read_to_string(out.join("provenance/timings.tsv")).unwrap_or_default();
    STAGES.map(|stage| {
        let line = text.lines().find(|line| line.starts_with(&format!("{stage}\tn/a\t")))?;
        line.split('\t').nth(2)?.parse().ok()
    })
}
