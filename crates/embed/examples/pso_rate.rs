//! How fast the swarm is, and how its energy falls.
//!
//! `cargo run --release -p espalier-embed --example pso_rate -- TREE.swc|neuron|airway|vessel [paper]
//! [uniform] [s|b|n] [PARTICLESxITERATIONS] [SEED]`
//!
//! The seed is that of the phantom and of the swarm. Prints one line per iteration, the rate, and the table of methods.
#![allow(clippy::print_stdout, clippy::disallowed_methods, reason = "an example that measures")]

use std::error::Error;
use std::time::Instant;

use espalier_embed::{Event, Freedom, Params, PsoParams, embed};
use espalier_model::swc::{SwcScale, parse};
use espalier_model::{MethodRow, Node, Tree};
use espalier_phantom::Kind;
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
    let tree = tree(&source, seed)?;
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

fn tree(name: &str, seed: u64) -> Result<Tree, Box<dyn Error>> {
    let kind = match name {
        "neuron" => Kind::Neuron,
        "airway" => Kind::Airway,
        "vessel" => Kind::Vessel,
        path => return swc_tree(&std::fs::read(path)?),
    };
    Ok(espalier_phantom::grow_tree(kind, &espalier_phantom::Params::default(), seed)?)
}

/// The first root's tree of a file, without nodes that lie on their parents.
fn swc_tree(bytes: &[u8]) -> Result<Tree, Box<dyn Error>> {
    let (traced, _) = parse(bytes, &SwcScale::micrometres())?;
    let order = parents_first(&traced.nodes.iter().map(|node| node.parent).collect::<Vec<_>>());
    let (mut nodes, mut place): (Vec<Node>, Vec<Option<usize>>) =
        (Vec::new(), vec![None; traced.nodes.len()]);
    for node_idx in order {
        let node = &traced.nodes[node_idx];
        let parent = node.parent.and_then(|parent| place[parent]);
        if let Some(same) = parent.filter(|&parent| nodes[parent].position_mm == node.position_mm) {
            place[node_idx] = Some(same);
        } else if parent.is_some() || nodes.is_empty() {
            place[node_idx] = Some(nodes.len());
            let (position_mm, radius_mm) = (node.position_mm, node.radius_mm);
            nodes.push(Node { position_mm, radius_mm, parent, kind: node.kind });
        }
    }
    Ok(Tree::new(&nodes)?)
}

/// Indices with every parent before its children.
fn parents_first(parents: &[Option<usize>]) -> Vec<usize> {
    let mut children = vec![Vec::new(); parents.len()];
    for (node, parent) in parents.iter().enumerate() {
        if let Some(parent) = *parent {
            children[parent].push(node);
        }
    }
    let mut order: Vec<usize> = (0..parents.len()).filter(|&node| parents[node].is_none()).collect();
    order.truncate(1);
    let mut idx = 0;
    while idx < order.len() {
        let node = order[idx];
        order.extend_from_slice(&children[node]);
        idx += 1;
    }
    order
}
