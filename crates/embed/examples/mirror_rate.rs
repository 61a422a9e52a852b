//! What the search for sides finds, and how fast it is.
//!
//! `cargo run --release -p espalier-embed --example mirror_rate -- [effort=E] [seed=S] [curl]
//! TREE.swc|neuron|airway|vessel[@SEED]…`; `curl` lets branches pass the trunk.
//!
//! One line per tree: nodes N, segments M, crossings, pairs that are too near and edges behind the root before and
//! after, changes of sides inside segments, evaluations, microseconds per evaluation (of all walks together), seconds.
//! Times are those of a run with the search less those of one without.
#![allow(clippy::print_stdout, clippy::disallowed_methods, reason = "an example that measures")]

mod trees;

use std::error::Error;
use std::time::Instant;

use espalier_embed::{KeepOut, Method, Params, SolverParams, embed};
use espalier_views::find_views;

fn main() -> Result<(), Box<dyn Error>> {
    let solver =
        SolverParams { untangling: false, descent: false, barrier: false, ..SolverParams::default() };
    let mut params = Params { methods: Vec::new(), method: Method::Solver, solver, ..Params::default() };
    let mut seed = 0;
    for word in std::env::args().skip(1) {
        if let Some(effort) = word.strip_prefix("effort=") {
            params.solver.effort = effort.parse()?;
        } else if let Some(number) = word.strip_prefix("seed=") {
            seed = number.parse()?;
        } else if word == "curl" {
            params.solver.root_keep_out = KeepOut::Off;
        } else {
            measure(&word, &params, seed)?;
        }
    }
    Ok(())
}

fn measure(word: &str, params: &Params, seed: u64) -> Result<(), Box<dyn Error>> {
    let (source, grown) = word.split_once('@').unwrap_or((word, "0"));
    let name = source.rsplit('/').next().unwrap_or(source);
    let Ok(tree) = trees::tree(source, grown.parse()?) else {
        println!("{name}: not a tree");
        return Ok(());
    };
    let views = find_views(&tree, &espalier_views::Params::default(), 0)?.hierarchy;
    let run = |mirrors: bool| -> Result<_, Box<dyn Error>> {
        let params = Params { solver: SolverParams { mirrors, ..params.solver.clone() }, ..params.clone() };
        let start = Instant::now();
        let embedded = embed(&tree, &views, &params, seed, &|_| {})?;
        Ok((embedded.report, start.elapsed().as_secs_f64()))
    };
    let (report, without) = (run(true)?, run(false)?.1);
    let seconds = report.1 - without;
    let count = |name: &str| report.0.get(name).unwrap_or(f64::NAN);
    let evaluations = count("mirror_evaluations");
    println!(
        "{name:<34} N {:>6} M {:>5} X {:>5} -> {:<4} near {:>4} -> {:<4} behind {:>3} -> {:<3} zigzags {:>4} ({:.1} rad) placement {:.3} \
         evaluations {evaluations:>9} {:>6.1} µs {seconds:.2} s",
        tree.n_nodes(),
        tree.branches().list().len(),
        count("mirror_crossings_before"),
        count("mirror_crossings"),
        count("mirror_near_before"),
        count("mirror_near"),
        count("mirror_behind_root_before"),
        count("mirror_behind_root"),
        count("mirror_zigzags"),
        count("mirror_zigzags_rad"),
        count("mirror_misplacement"),
        1e6 * seconds / evaluations.max(1.0),
    );
    Ok(())
}
