//! Whole phantom trees against their truth: `cargo run --release -p espalier-tests --example ground_truth`
//!
//! For each grid, an airway and a vessel tree of the phantom generator, from four masks: the voxels whose centre lies
//! in the body (`clean`), the same with 15 % of its surface's voxels flipped (`rough`), and what region growing makes of
//! its noisy CT, in a band that is given (`ct`), and by the preset (`preset`), which finds threshold and trachea itself.
//! Columns and tolerances are those of `espalier_tests::ground_truth`. Every tip of the truth counts; what a grid cannot
//! show is part of the figure.
//! `--only WORD` takes the rows that hold the word, `--small` one grid, `--grid X,Y,Z` that of this spacing, `--seed N` another tree of each kind than that
//! of seed 7; `--false` lists each tip that is not true, with its branch, `--lost` each tip that was not found, with
//! what lies nearest to it.
#![allow(clippy::print_stdout, clippy::print_stderr, clippy::disallowed_methods, reason = "a program")]

mod bands;
mod false_tips;
mod lost_tips;

use std::process::ExitCode;

use espalier_tests::ground_truth::phantoms::{self, Case, GRIDS_MM, Scan};

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let only = arguments.iter().position(|word| word == "--only").and_then(|at| arguments.get(at + 1));
    let grid =
        arguments.iter().position(|word| word == "--grid").and_then(|at| spacing(arguments.get(at + 1)?));
    let grids: &[[f64; 3]] = match &grid {
        Some(grid) => std::slice::from_ref(grid),
        None if arguments.iter().any(|word| word == "--small") => &GRIDS_MM[2..3],
        None => &GRIDS_MM,
    };
    let is_lost_listed = arguments.iter().any(|word| word == "--lost");
    let is_false_listed = arguments.iter().any(|word| word == "--false");
    let seed =
        arguments.iter().position(|word| word == "--seed").and_then(|at| arguments.get(at + 1)?.parse().ok());
    println!("{}", phantoms::HEADING);
    for &spacing_mm in grids {
        for kind in phantoms::KINDS {
            for scan in Scan::ALL {
                let case = Case { kind, spacing_mm, scan, seed: seed.unwrap_or(7) };
                if only.is_some_and(|word| !case.to_string().contains(word.as_str())) {
                    continue;
                }
                match phantoms::measure(&case) {
                    Ok(measured) => {
                        println!("{measured}");
                        if case.scan.is_ct() {
                            bands::print(&measured);
                        }
                        if is_lost_listed {
                            lost_tips::print(&measured);
                        }
                        if is_false_listed {
                            false_tips::print(&measured);
                        }
                    }
                    Err(error) => {
                        eprintln!("error: {case}: {error}");
                        return ExitCode::FAILURE;
                    }
                }
            }
        }
    }
    ExitCode::SUCCESS
}

/// Three numbers with commas.
fn spacing(text: &str) -> Option<[f64; 3]> {
    let numbers: Option<Vec<f64>> = text.split(',').map(|number| number.parse().ok()).collect();
    numbers?.try_into().ok()
}
