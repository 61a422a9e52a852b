//! The solver without one of its parts.

use std::error::Error;

use espalier_embed::{Method, Params, SolverParams};
use espalier_geom::math::{exp, ln};
use espalier_model::Energy;

use crate::Options;
use crate::measure::{measure, short, views};
use crate::trees::{Named, trees};

/// The solver without something.
struct Variant {
    name: &'static str,
    change: fn(&mut SolverParams),
    /// The variant to hold it against.
    base: usize,
    /// Whether both have the same targets, so that all of the energy can be compared; else what placement costs says
    /// nothing, and lengths and angles are compared.
    has_same_targets: bool,
}

/// The search for sides alone solves many trees, and leaves the other parts nothing to do: they are left out once more
/// without it.
const VARIANTS: [Variant; 8] = [
    Variant { name: "whole", change: |_| {}, base: 0, has_same_targets: true },
    Variant {
        name: "no untangling",
        change: |params| params.untangling = false,
        base: 0,
        has_same_targets: true,
    },
    Variant { name: "no descent", change: |params| params.descent = false, base: 0, has_same_targets: true },
    Variant { name: "no barrier", change: |params| params.barrier = false, base: 0, has_same_targets: true },
    Variant { name: "no mirrors", change: |params| params.mirrors = false, base: 0, has_same_targets: false },
    Variant {
        name: "no mirrors, no untangling",
        change: |params| (params.mirrors, params.untangling) = (false, false),
        base: 4,
        has_same_targets: true,
    },
    Variant {
        name: "no mirrors, no descent",
        change: |params| (params.mirrors, params.descent) = (false, false),
        base: 4,
        has_same_targets: true,
    },
    Variant {
        name: "no mirrors, no barrier",
        change: |params| (params.mirrors, params.barrier) = (false, false),
        base: 4,
        has_same_targets: true,
    },
];
/// Added to energies before they are divided: those of rounding are all alike.
const NOTHING: f64 = 1e-6;

/// What one variant made of one tree; none where it failed.
type Outcome = Option<Energy>;

/// Prints the table, line by line; whether nothing failed.
pub(crate) fn print(options: &Options) -> Result<bool, Box<dyn Error>> {
    println!("E and its part of lengths and angles, against the targets of the row's own sides; seconds");
    println!("tree | N | variant | E | E length+angle | s");
    println!("--- | --: | --- | --: | --: | --:");
    let mut outcomes: Vec<Vec<Outcome>> = vec![Vec::new(); VARIANTS.len()];
    let mut is_certified = true;
    for Named { name, tree } in trees(options)? {
        let views = views(&tree)?;
        for (variant, outcomes) in VARIANTS.iter().zip(&mut outcomes) {
            let mut params = Params { method: Method::Solver, methods: Vec::new(), ..Params::default() };
            (variant.change)(&mut params.solver);
            let head = format!("{name} | {} | {}", tree.n_nodes(), variant.name);
            match measure(&tree, &views, &params) {
                Ok(measured) => {
                    let energy = measured.row("solver").map(|row| row.energy);
                    let part = |of: fn(&Energy) -> f64| energy.as_ref().map_or(f64::NAN, of);
                    println!(
                        "{head} | {} | {} | {:.2}",
                        short(part(Energy::total)),
                        short(part(exact_terms)),
                        measured.seconds_of("solver")
                    );
                    outcomes.push(energy);
                }
                Err(error) => {
                    println!("{head} | failed: {error}");
                    is_certified = false;
                    outcomes.push(None);
                }
            }
        }
    }
    println!();
    for (variant, own) in VARIANTS.iter().zip(&outcomes).skip(1) {
        println!("{}", verdict(variant, own, &outcomes[variant.base]));
    }
    Ok(is_certified)
}

/// What lengths and angles cost.
fn exact_terms(energy: &Energy) -> f64 {
    energy.length + energy.angle
}

/// How much the energy is without the part.
fn verdict(variant: &Variant, own: &[Outcome], base: &[Outcome]) -> String {
    let (energy, what): (fn(&Energy) -> f64, &str) =
        if variant.has_same_targets { (Energy::total, "E") } else { (exact_terms, "E length+angle") };
    let ratio = |(own, base): (&Outcome, &Outcome)| {
        Some((energy(own.as_ref()?) + NOTHING) / (energy(base.as_ref()?) + NOTHING))
    };
    let ratios: Vec<f64> = own.iter().zip(base).filter_map(ratio).collect();
    let mean = ratios.iter().map(|&ratio| ln(ratio)).sum::<f64>() / ratios.len().max(1) as f64;
    let n_higher = ratios.iter().filter(|&&ratio| ratio > 1.001).count();
    let n_lower = ratios.iter().filter(|&&ratio| ratio < 0.999).count();
    format!(
        "{}: {what} {:.2} times that of {:?} (geometric mean), higher on {n_higher} and lower on {n_lower} of {} trees",
        variant.name,
        exp(mean),
        VARIANTS[variant.base].name,
        ratios.len()
    )
}
