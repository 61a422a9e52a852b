//! Every tree by every method.

use std::error::Error;

use espalier_embed::{Method, Params, PsoParams};
use espalier_model::{MethodRow, TargetKind};

use crate::measure::{Measured, measure, short, views};
use crate::trees::{Named, trees};
use crate::{Options, Swarm};

/// Up to so many nodes the swarm has its full size, beyond fewer particles for equal work.
const FULL_SWARM_NODES: u32 = 300;
/// Beyond so many there is none.
const MOST_SWARM_NODES: u32 = 5000;
/// Metric 2 of two layouts that differ by less is equal: rounding of the coordinates.
const EQUAL: f64 = 1e-9;

/// What the footer counts.
#[derive(Default)]
struct Tally {
    n_trees: usize,
    n_certified: usize,
    n_optimal: usize,
    n_optimal_of_moderate: usize,
    n_moderate: usize,
    n_metric2_below_all: usize,
    n_stress_at_most_marino: usize,
    n_mirrored: usize,
}

/// Prints the table; whether every result is certified.
pub(crate) fn print(options: &Options) -> Result<bool, Box<dyn Error>> {
    println!(
        "tree | method | N | M | E | E length+angle | length mean / max | Metric 1 mean / max | Metric 2 mean / max | degrees mean / max | stress | seconds | crossings | evaluations | targets"
    );
    println!("--- | --- | --: | --: | --: | --: | --: | --: | --: | --: | --: | --: | --: | --: | ---");
    let mut tally = Tally::default();
    for named in trees(options)? {
        let measured = match measure_all(&named, options.swarm) {
            Ok(measured) => measured,
            Err(error) => {
                println!("{} | failed: {error} | {}", named.name, named.tree.n_nodes());
                tally.n_trees += 1;
                continue;
            }
        };
        for (idx, row) in measured.embedding.methods.iter().enumerate() {
            print_row(&named, row, measured.seconds_of_row(idx));
        }
        if !measured.embedding.methods.iter().any(|row| row.method.starts_with("pso")) {
            println!("{} | pso | {} | – ", named.name, named.tree.n_nodes());
        }
        tally.count(&named, &measured);
    }
    tally.print();
    Ok(tally.n_certified == tally.n_trees)
}

fn measure_all(named: &Named, swarm: Swarm) -> Result<Measured, Box<dyn Error>> {
    let mut methods = vec![Method::Projection, Method::Radial, Method::Marino, Method::Cone, Method::Solver];
    if swarm != Swarm::None {
        methods.push(Method::Pso);
    }
    let paper =
        PsoParams { full_size_nodes: FULL_SWARM_NODES, max_nodes: MOST_SWARM_NODES, ..PsoParams::paper() };
    let pso = if swarm == Swarm::Full { paper } else { PsoParams::default() };
    measure(&named.tree, &views(&named.tree)?, &Params { methods, pso, ..Params::default() })
}

fn print_row(Named { name, tree }: &Named, row: &MethodRow, seconds: f64) {
    let losses = &row.losses;
    let pair = |mean: f64, max: f64| format!("{} / {}", short(mean), short(max));
    let cells = [
        name.clone(),
        row.method.clone(),
        tree.n_nodes().to_string(),
        tree.branches().list().len().to_string(),
        short(row.energy.total()),
        short(row.energy.length + row.energy.angle),
        pair(losses.length_loss_mean, losses.length_loss_max),
        pair(losses.angle_loss_mean, losses.angle_loss_max),
        pair(losses.angle3d_loss_mean, losses.angle3d_loss_max),
        pair(losses.angle3d_error_mean_deg, losses.angle3d_error_max_deg),
        format!("{:.4}", losses.stress),
        format!("{seconds:.3}"),
        row.crossings.to_string(),
        row.evaluations.to_string(),
        row.targets.name().to_owned(),
    ];
    println!("{}", cells.join(" | "));
}

impl Tally {
    fn count(&mut self, named: &Named, measured: &Measured) {
        /// Trees up to this size are those of which half have to be optimal.
        const MODERATE: usize = 2500;
        self.n_trees += 1;
        self.n_certified += usize::from(measured.embedding.certificate.holds());
        let Some(solver) = measured.row("solver") else { return };
        let is_optimal = solver.energy.length + solver.energy.angle == 0.0 && solver.crossings == 0;
        let is_moderate = named.tree.n_nodes() <= MODERATE;
        self.n_optimal += usize::from(is_optimal);
        self.n_moderate += usize::from(is_moderate);
        self.n_optimal_of_moderate += usize::from(is_optimal && is_moderate);
        let is_baseline = |row: &&MethodRow| {
            ["projection", "radial", "marino", "cone", "pso"].iter().any(|name| row.method.starts_with(name))
        };
        let own = solver.losses.angle3d_loss_mean;
        let mut baselines = measured.embedding.methods.iter().filter(is_baseline);
        let is_below = baselines.all(|row| own < row.losses.angle3d_loss_mean || own <= EQUAL);
        self.n_metric2_below_all += usize::from(is_below);
        let marino = measured.row("marino").map_or(f64::INFINITY, |row| row.losses.stress);
        self.n_stress_at_most_marino += usize::from(solver.losses.stress <= marino);
        let is_mirrored =
            matches!(solver.targets, TargetKind::IntrinsicMirrored | TargetKind::ProjectedMirrored);
        self.n_mirrored += usize::from(is_mirrored);
    }

    fn print(&self) {
        let n = self.n_trees;
        println!();
        println!("certified free of crossings: {} of {n} trees", self.n_certified);
        println!(
            "proven optimal for its targets (E = 0 but for placement): {} of {n}; of those up to 2500 nodes {} of {}",
            self.n_optimal, self.n_optimal_of_moderate, self.n_moderate
        );
        println!("Metric 2 mean below every baseline, or 0: {} of {n}", self.n_metric2_below_all);
        println!("stress at most marino's: {} of {n}", self.n_stress_at_most_marino);
        println!("sides of the targets searched (the same for every method): {} of {n}", self.n_mirrored);
        println!("the solver's seconds include the search for sides; the size of the swarm is in its name");
    }
}
