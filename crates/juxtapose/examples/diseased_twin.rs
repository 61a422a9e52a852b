//! Writes a phantom tree and its diseased twin as SWC files in mm, to hold them against each other:
//!
//! ```text
//! cargo run -p espalier-juxtapose --example diseased_twin -- airway out
//! espalier juxtapose out/healthy.swc out/diseased.swc -o out/juxtaposed
//! ```
#![allow(clippy::print_stderr, reason = "an example speaks to whoever runs it")]

use std::error::Error;
use std::path::PathBuf;

use espalier_model::{Tree, swc};
use espalier_phantom::{Disease, Growth, Kind, Params, grow_tree, twin};
use glam::{DMat3, DVec3};

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let kind = if arguments.next().as_deref() == Some("neuron") { Kind::Neuron } else { Kind::Airway };
    let folder = PathBuf::from(arguments.next().unwrap_or_else(|| "out".to_owned()));
    let tree = grow_tree(kind, &Params::default(), 7)?;
    std::fs::create_dir_all(&folder)?;
    for (name, tree) in [("healthy.swc", &tree), ("diseased.swc", &twin(&tree, &disease(&tree), 7)?)] {
        std::fs::write(folder.join(name), swc::write(tree, &[]))?;
        eprintln!("{}: {} branches", folder.join(name).display(), tree.branches().list().len());
    }
    Ok(())
}

/// A subtree and two tips gone, every sixth long branch narrowed to a half, one new branch; turned and moved.
fn disease(tree: &Tree) -> Disease {
    let branches = tree.branches();
    let list = branches.list();
    let length_mm = |branch: usize| branches.length_mm(tree, branch);
    let gone = (0..list.len()).filter(|&b| list[b].generation == 4 && list[b].strahler == 2).nth(1);
    let tips = (0..list.len()).filter(|&b| list[b].strahler == 1).step_by(9).take(2);
    let median_mm = tree.length_mm() / list.len() as f64;
    let long: Vec<usize> = (1..list.len()).filter(|&b| length_mm(b) > median_mm).collect();
    let longest = (1..list.len()).max_by(|&a, &b| length_mm(a).total_cmp(&length_mm(b))).unwrap_or(0);
    let extent_mm = tree.extent_mm();
    Disease {
        lost: gone.into_iter().chain(tips).collect(),
        narrowed: long.iter().step_by(6).map(|&branch| (branch, 0.5)).collect(),
        grown: vec![Growth {
            branch: longest,
            share: 0.5,
            direction: DVec3::new(0.2, 1.0, 0.3),
            length_mm: 0.2 * extent_mm,
        }],
        jitter_mm: 1e-3 * extent_mm,
        moved: (DMat3::from_rotation_y(0.4), DVec3::splat(0.1 * extent_mm)),
    }
}
