//! What the search for sides finds, and how fast it is.
//!
//! `cargo run --release -p espalier-embed --example mirror_rate -- [effort=E] [seed=S] [curl]
//! TREE.swc|neuron|airway|vessel[@SEED]…`; `curl` lets branches pass the trunk.
//!
//! One line per tree: nodes N, segments M, crossings, pairs that are too near and edges behind the root before and
//! after, changes of sides inside segments, evaluations, microseconds per evaluation (of all walks together), seconds.
//! Times are those of a run with the search less those of one without.
#![allow(clippy::print_stdout, clippy::disallowed_methods, reason = "an example that measures")]

use std::error::Error;
use std::time::Instant;

use espalier_embed::{KeepOut, Method, Params, SolverParams, embed};
use espalier_model::swc::{SwcScale, parse};
use espalier_model::{Node, Tree};
use espalier_phantom::Kind;
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
    let Ok(tree) = tree(source, grown.parse()?) else {
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
