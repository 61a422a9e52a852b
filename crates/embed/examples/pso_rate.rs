//! How fast the swarm is, and how its energy falls.
//!
//! `cargo run --release -p espalier-embed --example pso_rate -- TREE.swc|neuron|airway|vessel [paper]
//! [uniform] [s|b|n] [PARTICLESxITERATIONS] [SEED]`
//!
//! The seed is that of the phantom and of the swarm. Prints one line per iteration, the rate, and the table of methods.
#![allow(clippy::print_stdout, clippy::disallowed_methods, reason = "an example that measures")]

mod trees;

use std::error::Error;
use std::time::Instant;

use espalier_embed::{Event, Freedom, Params, PsoParams, embed};
use espalier_model::MethodRow;
use espalier_views::find_views;

fn main() -> Result<(), Box<dyn Error>> {
    let mut words = std::env::args().skip(1);
    let source = words.next().unwrap_or_else(|| "neuron".to_owned());
    let (mut params, mut seed) = (Params::default(), 0);
    for word in words {
        match word.as_str() {
            "paper" => params = Params::paper(),
            "uniform" => {
                let PsoParams { omega_g, omega_p, omega_target, pull, .. } = PsoParams::paper();
                params.pso = PsoParams { omega_g, omega_p, omega_target, pull, ..params.pso };
            }
            "s" => params.pso.freedom = Freedom::S,
            "b" => params.pso.freedom = Freedom::B,
            "n" => params.pso.freedom = Freedom::N,
            _ => match word.split_once('x') {
                Some((particles, iterations)) => {
                    (params.pso.particles, params.pso.iterations) = (particles.parse()?, iterations.parse()?);
                }
                None => seed = word.parse()?,
            },
        }
    }
    let tree = trees::tree(&source, seed)?;
    let views = find_views(&tree, &espalier_views::Params::default(), seed)?.hierarchy;
    println!("{} nodes, {} branches, {params:?}", tree.n_nodes(), tree.branches().list().len());

    let start = Instant::now();
    let embedded = embed(&tree, &views, &params, seed, &|event| {
        let Event::Searching(p) = event else { return };
        let seconds = start.elapsed().as_secs_f64();
        println!(
            "{:>4}/{} energy {:<12.6} crossings {:<4} evaluations {:>8} {seconds:.2} s {:.0}/s",
            p.done,
            p.total,
            p.energy,
            p.crossings,
            p.evaluations,
            p.evaluations as f64 / seconds
        );
    })?;
    let embedding = embedded.embedding;
    println!("{} {:?} {:?}", embedding.method, embedding.termination, embedding.energy);
    println!("{:.2} s in all\n{}", start.elapsed().as_secs_f64(), MethodRow::to_tsv(&embedding.methods));
    Ok(())
}
