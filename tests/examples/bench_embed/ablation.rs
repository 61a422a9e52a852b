//! The solver without one of its parts.

use std::error::Error;

use espalier_embed::{Method, Params, SolverParams};

use crate::Options;
use crate::measure::{measure, short, views};
use crate::trees::{Named, trees};

type Change = fn(&mut SolverParams);

/// What is left out.
const VARIANTS: [(&str, Change); 5] = [
    ("whole", |_| {}),
    ("no mirrors", |params| params.mirrors = false),
    ("no untangling", |params| params.untangling = false),
    ("no descent", |params| params.descent = false),
    ("no barrier", |params| params.barrier = false),
];

/// Prints the table.
pub(crate) fn print(options: &Options) -> Result<bool, Box<dyn Error>> {
    let heads: Vec<String> = VARIANTS.iter().map(|(name, _)| format!("{name}: E | s")).collect();
    println!("tree | N | {}", heads.join(" | "));
    println!("--- | --:{}", " | --: | --:".repeat(VARIANTS.len()));
    // Natural logarithms of the energy without a part over that with all.
    let mut logs = vec![Vec::new(); VARIANTS.len()];
    let mut is_certified = true;
    for Named { name, tree } in trees(options)? {
        let views = views(&tree)?;
        let mut cells = vec![name, tree.n_nodes().to_string()];
        let mut whole = f64::NAN;
        for (idx, (_, change)) in VARIANTS.iter().enumerate() {
            let mut params = Params { method: Method::Solver, methods: Vec::new(), ..Params::default() };
            change(&mut params.solver);
            match measure(&tree, &views, &params) {
                Ok(measured) => {
                    let energy = measured.row("solver").map_or(f64::NAN, |row| row.energy.total());
                    if idx == 0 {
                        whole = energy;
                    }
                    logs[idx].push(espalier_geom::math::ln(energy / whole));
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
    for ((name, _), logs) in VARIANTS.iter().zip(&logs).skip(1) {
        let finite: Vec<f64> = logs.iter().copied().filter(|log| log.is_finite()).collect();
        let mean = finite.iter().sum::<f64>() / finite.len().max(1) as f64;
        let n_worse = finite.iter().filter(|&&log| log > 1e-6).count();
        println!(
            "{name}: E {:.2} times that of the whole (geometric mean), higher on {n_worse} of {} trees",
            espalier_geom::math::exp(mean),
            finite.len()
        );
    }
    println!("without mirrors the targets are others, and E is against those");
    Ok(is_certified)
}
