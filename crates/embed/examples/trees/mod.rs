//! Trees for examples: phantoms by name, and SWC files.

use std::error::Error;

use espalier_model::swc::{SwcScale, parse};
use espalier_model::{Node, Tree};
use espalier_phantom::Kind;

/// The tree of a file, or a phantom's by its name.
pub(crate) fn tree(name: &str, seed: u64) -> Result<Tree, Box<dyn Error>> {
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
