//! The solver without one of its parts.

use std::error::Error;

use espalier_embed::{Method, Params, SolverParams};
use espalier_geom::math::{exp, ln};

use crate::Options;
use crate::measure::{measure, short, views};
use crate::trees::{Named, trees};

type Change = fn(&mut SolverParams);

/// What is left out, and the variant to hold it against. The search for sides alone solves many trees, and leaves the
/// other parts nothing to do: they are left out once more without it.
const VARIANTS: [(&str, Change, usize); 8] = [
    ("whole", |_| {}, 0),
    ("no untangling", |params| params.untangling = false, 0),
    ("no descent", |params| params.descent = false, 0),
    ("no barrier", |params| params.barrier = false, 0),
    ("no mirrors", |params| params.mirrors = false, 0),
    ("no mirrors, no untangling", |params| (params.mirrors, params.untangling) = (false, false), 4),
    ("no mirrors, no descent", |params| (params.mirrors, params.descent) = (false, false), 4),
    ("no mirrors, no barrier", |params| (params.mirrors, params.barrier) = (false, false), 4),
];
/// Added to energies before they are divided: those of rounding are all alike.
const NOTHING: f64 = 1e-6;

/// Prints the table.
pub(crate) fn print(options: &Options) -> Result<bool, Box<dyn Error>> {
    let heads: Vec<String> = VARIANTS.iter().map(|(name, _, _)| format!("{name}: E | s")).collect();
    println!("E is that of lengths and angles, against the targets of the row's own sides");
    println!("tree | N | {}", heads.join(" | "));
    println!("--- | --:{}", " | --: | --:".repeat(VARIANTS.len()));
    let mut energies = vec![Vec::new(); VARIANTS.len()];
    let mut is_certified = true;
    for Named { name, tree } in trees(options)? {
        let views = views(&tree)?;
        let mut cells = vec![name, tree.n_nodes().to_string()];
        for ((_, change, _), energies) in VARIANTS.iter().zip(&mut energies) {
            let mut params = Params { method: Method::Solver, methods: Vec::new(), ..Params::default() };
            change(&mut params.solver);
            let measured = measure(&tree, &views, &params);
            let row = measured.as_ref().ok().and_then(|measured| measured.row("solver"));
            let energy = row.map_or(f64::NAN, |row| row.energy.length + row.energy.angle);
            energies.push(energy);
            match measured {
                Ok(measured) => {
                    cells.extend([short(energy), format!("{:.2}", measured.seconds_of("solver"))]);
                }
                Err(error) => {
                    is_certified = false;
                    cells.extend([format!("failed: {error}"), String::new()]);
                }
            }
        }
        println!("{}", cells.join(" | "));
    }
    println!();
    for ((name, _, base), own) in VARIANTS.iter().zip(&energies).skip(1) {
        let ratios = own.iter().zip(&energies[*base]).map(|(own, base)| (own + NOTHING) / (base + NOTHING));
        let ratios: Vec<f64> = ratios.filter(|ratio| ratio.is_finite()).collect();
        let mean = ratios.iter().map(|&ratio| ln(ratio)).sum::<f64>() / ratios.len().max(1) as f64;
        let n_worse = ratios.iter().filter(|&&ratio| ratio > 1.001).count();
        println!(
            "{name}: E {:.2} times that of {:?} (geometric mean), higher on {n_worse} of {} trees",
            exp(mean),
            VARIANTS[*base].0,
            ratios.len()
        );
    }
    Ok(is_certified)
}
