//! The solver against the paper's swarm, at equal freedom and equal seconds, both ways.
//!
//! Both may choose one length ratio per segment and one angle ratio per node, and both have the energy of Eq. 4 alone:
//! no placement term. `mirrored` has targets whose sides were searched, `as they are` those of the local planes; the
//! two methods of a row have the same targets.

use std::error::Error;

use espalier_embed::{Freedom, Method, Params, PsoParams, SolverParams};
use espalier_model::{Tree, ViewHierarchy};
use espalier_phantom::{Kind, grow_tree};

use crate::measure::{Measured, measure, short, views};
use crate::trees::{Named, trees};
use crate::{Options, Swarm};

/// Seeds of the neurons that are measured where no files are named.
const SEEDS: std::ops::Range<u64> = 0..5;

/// Prints the table.
pub(crate) fn print(options: &Options) -> Result<bool, Box<dyn Error>> {
    println!(
        "tree | N | targets | solver E | solver s | swarm | swarm E after the solver's s | ratio | swarm E at its end | swarm s | solver E given the swarm's s | s it took | ratio"
    );
    println!("--- | --: | --- | --: | --: | --- | --: | --: | --: | --: | --: | --: | --:");
    let mut ratios = Vec::new();
    for Named { name, tree } in neurons(options)? {
        let views = views(&tree)?;
        for mirrors in [true, false] {
            let solver = SolverParams { mirrors, ..SolverParams::default() };
            let params = Params { solver, w_placement: 0.0, ..Params::default() };
            let alone =
                |method: Method, pso: PsoParams| Params { method, methods: vec![], pso, ..params.clone() };
            let solved = measure(&tree, &views, &alone(Method::Solver, PsoParams::default()))?;
            let full = if options.swarm == Swarm::Small { PsoParams::default() } else { PsoParams::paper() };
            let swarm =
                measure(&tree, &views, &alone(Method::Pso, PsoParams { freedom: Freedom::N, ..full }))?;
            let (Some(own), Some(swarmed)) = (solved.row("solver"), swarm.row("pso")) else { continue };
            let (solver_e, swarm_e) = (own.energy.total(), swarmed.energy.total());
            let seconds = solved.seconds_of("solver");
            let (early_e, swarm_seconds) = (after(&swarm, seconds), swarm.seconds_of("pso"));
            let longer = given(&tree, &views, &params, swarm_seconds / seconds)?;
            let long_e = longer
                .as_ref()
                .and_then(|longer| longer.row("solver"))
                .map_or(solver_e, |row| row.energy.total());
            let long_seconds = longer.as_ref().map_or(seconds, |longer| longer.seconds_of("solver"));
            let cells = [
                name.clone(),
                tree.n_nodes().to_string(),
                if mirrors { "mirrored" } else { "as they are" }.to_owned(),
                short(solver_e),
                format!("{seconds:.2}"),
                swarmed.method.clone(),
                short(early_e),
                ratio(early_e, solver_e),
                short(swarm_e),
                format!("{swarm_seconds:.2}"),
                short(long_e),
                format!("{long_seconds:.2}"),
                ratio(swarm_e, long_e),
            ];
            println!("{}", cells.join(" | "));
            ratios.push((early_e / solver_e).min(swarm_e / long_e));
        }
    }
    let n_small = ratios.iter().filter(|&&ratio| ratio < 50.0).count();
    println!("\nratio below 50 in {n_small} of {} rows; NaN is 0 / 0: both proven optimal", ratios.len());
    Ok(true)
}

fn neurons(options: &Options) -> Result<Vec<Named>, Box<dyn Error>> {
    if !options.paths.is_empty() {
        return trees(options);
    }
    let grow = |seed: u64| {
        let tree = grow_tree(Kind::Neuron, &espalier_phantom::Params::default(), seed)?;
        Ok(Named { name: format!("neuron {seed}"), tree })
    };
    SEEDS.map(grow).collect()
}

/// The solver with so many times its work, if that is more and there is something to gain; it stops where it no longer
/// gains.
fn given(
    tree: &Tree,
    views: &ViewHierarchy,
    params: &Params,
    times: f64,
) -> Result<Option<Measured>, Box<dyn Error>> {
    const MOST_EFFORT: f64 = 1000.0;
    if times <= 1.0 {
        return Ok(None);
    }
    let solver = SolverParams { effort: times.min(MOST_EFFORT), ..params.solver.clone() };
    let params = Params { method: Method::Solver, methods: vec![], solver, ..params.clone() };
    Ok(Some(measure(tree, views, &params)?))
}

/// The best energy of the swarm after so many of its seconds; at its start, if it took longer.
fn after(swarm: &Measured, seconds: f64) -> f64 {
    let until = swarm.swarm.iter().take_while(|(at, _)| *at <= seconds).last();
    until.or(swarm.swarm.first()).map_or(f64::NAN, |(_, progress)| progress.energy)
}

fn ratio(swarm: f64, solver: f64) -> String {
    if solver == 0.0 && swarm > 0.0 { "∞".to_owned() } else { short(swarm / solver) }
}
