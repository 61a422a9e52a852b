//! Random trees of eight families: every result certified, and checked by other means.
//!
//! Prints each failure with what it takes to make the tree again: family, nodes, key.

#[path = "../../../crates/embed/tests/common/mod.rs"]
mod common;

use std::error::Error;
use std::time::Instant;

use espalier_embed::{Method, Params, SolverParams, embed};
use espalier_model::{Termination, Tree};
use espalier_verify::meetings;
use rayon::prelude::*;

use crate::Options;
use crate::measure::views;

/// Work that the solver may take per tree: the campaign looks for crossings, not for the last percent.
const EFFORT: f64 = 0.02;
/// A tree that takes longer is named.
const SLOW_SECONDS: f64 = 60.0;

/// What became of one tree.
struct Outcome {
    family: usize,
    is_optimal: bool,
    seconds: f64,
    fault: Option<String>,
}

/// Runs the campaign; whether nothing failed.
pub(crate) fn print(options: &Options) -> Result<bool, Box<dyn Error>> {
    let start = Instant::now();
    let keys: Vec<u32> = (0..options.n_trees).map(|idx| options.seed.wrapping_add(idx)).collect();
    let mut all = Vec::new();
    for (done, part) in keys.chunks(40).enumerate() {
        let outcomes: Vec<Outcome> = part.par_iter().map(|&key| run(key, options.largest)).collect();
        for fault in outcomes.iter().filter_map(|outcome| outcome.fault.as_ref()) {
            println!("FAILED {fault}");
        }
        all.extend(outcomes);
        if done % 5 == 4 || part.len() < 40 {
            println!("{} trees, {:.0} s", all.len(), start.elapsed().as_secs_f64());
        }
    }
    for (family, name) in common::FAMILIES.iter().enumerate() {
        let of_family: Vec<&Outcome> = all.iter().filter(|outcome| outcome.family == family).collect();
        let n_optimal = of_family.iter().filter(|outcome| outcome.is_optimal).count();
        let slowest = of_family.iter().map(|outcome| outcome.seconds).fold(0.0, f64::max);
        let n_failed = of_family.iter().filter(|outcome| outcome.fault.is_some()).count();
        println!(
            "{name:<12} {:>6} trees, {n_failed} failed, {n_optimal} proven optimal, slowest {slowest:.1} s",
            of_family.len()
        );
    }
    let n_failed = all.iter().filter(|outcome| outcome.fault.is_some()).count();
    println!("{} trees, {n_failed} failed, {:.0} s", all.len(), start.elapsed().as_secs_f64());
    Ok(n_failed == 0)
}

/// From 1 to 5000 nodes, small trees more often: the size is uniform on logarithmic paper.
fn tree_of(key: u32, largest: usize) -> (usize, usize, Tree) {
    let family = key as usize % 8;
    let mut stream = common::stream(key ^ 0x5eed);
    let log = stream.unit() * espalier_geom::math::ln(largest.min(5000) as f64 + 1.0);
    let n_nodes = (espalier_geom::math::exp(log) as usize).max(1);
    let decades = [0.0, 0.5, 2.0, 6.0][stream.below(4) as usize];
    let is_flat = stream.below(4) == 0;
    (family, n_nodes, common::random_tree(family, n_nodes, decades, is_flat, key))
}

fn run(key: u32, largest: usize) -> Outcome {
    let (family, n_nodes, tree) = tree_of(key, largest);
    let start = Instant::now();
    let params = Params {
        method: Method::Solver,
        methods: Vec::new(),
        solver: SolverParams { effort: EFFORT, ..SolverParams::default() },
        ..Params::default()
    };
    let made = views(&tree).and_then(|views| Ok(embed(&tree, &views, &params, 0, &|_| {})?));
    let seconds = start.elapsed().as_secs_f64();
    let fault = match &made {
        Err(error) => Some(error.to_string()),
        Ok(made) => {
            let found = meetings(&tree, &made.embedding.positions_mm);
            let crossings = made.embedding.certificate.crossings;
            (found.count > 0 || crossings > 0)
                .then(|| format!("{crossings} crossings certified, {} found", found.count))
                .or_else(|| (seconds > SLOW_SECONDS).then(|| format!("{seconds:.0} s")))
        }
    };
    Outcome {
        family,
        is_optimal: made.is_ok_and(|made| made.embedding.termination == Termination::Optimal),
        seconds,
        fault: fault
            .map(|fault| format!("{} of {n_nodes} nodes, key {key}: {fault}", common::FAMILIES[family])),
    }
}
