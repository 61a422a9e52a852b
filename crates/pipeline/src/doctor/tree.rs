//! What a traced tree is.
//!
//! **Input** an SWC file, or polylines of VTK. **Output** nodes, roots, branch points, radii, extent, and what a run makes
//! of them.

use std::path::Path;

use espalier_model::Tree;
use espalier_model::swc::Traced;
use glam::DVec3;

use super::Findings;
use crate::config::Source;
use crate::error::Error;
use crate::estimate::Sizes;
use crate::folder::RunFolder;
use crate::run::{self, Request, boxed};
use crate::stage::Stage;
use crate::steps;

pub(super) fn examine(run: &Request, path: &Path, source: &Source) -> Result<Findings, Error> {
    steps::check_readable(path, false)?;
    let mut artifacts = run::artifacts_of(run, source);
    let nowhere = RunFolder::to_read(Path::new(""));
    let lookup = crate::artifacts::Lookup { folder: &nowhere, stage: Stage::Tree };
    let (traced, report) = artifacts.traced(lookup)?;
    let mut found = Findings::default();
    found.fact("kind", "tree", "a traced tree");
    describe(&traced, &mut found);
    for warning in report.warnings {
        found.advise(warning.code, warning.message, "");
    }
    advise(&traced, &mut found);
    let built = espalier_tree::from_traced(&traced, &run.loaded.config.tree)
        .map_err(|error| Error::stage(Stage::Tree)(boxed(error)))?;
    let tree = &built.tree;
    if artifacts.is_unit_guessed {
        advise_on_unit(tree, extent_mm(&traced).max_element(), &mut found);
    }
    let (n_nodes, n_branches) = (tree.n_nodes(), tree.branches().list().len());
    found.fact("tree_nodes", n_nodes, format!("{n_nodes} in the tree that a run makes of it"));
    found.fact("tree_branches", n_branches, n_branches.to_string());
    found.sizes = Some(Sizes::default().and_tree(tree));
    found.commands.push(Vec::new());
    Ok(found)
}

fn describe(traced: &Traced, found: &mut Findings) {
    let n_nodes = traced.nodes.len();
    let n_roots = n_roots(traced);
    let mut n_children = vec![0_usize; n_nodes];
    traced.nodes.iter().filter_map(|node| node.parent).for_each(|parent| n_children[parent] += 1);
    let n_forks = n_children.iter().filter(|count| **count > 1).count();
    let n_tips = n_children.iter().filter(|count| **count == 0).count();
    let n_zero = traced.nodes.iter().filter(|node| node.radius_mm == 0.0).count();
    let extent = extent_mm(traced);
    found.fact("nodes", n_nodes, n_nodes.to_string());
    found.fact("roots", n_roots, n_roots.to_string());
    found.fact("branch_points", n_forks, n_forks.to_string());
    found.fact("tips", n_tips, n_tips.to_string());
    found.fact("zero_radii", n_zero, n_zero.to_string());
    let radii = || traced.nodes.iter().map(|node| node.radius_mm).filter(|radius| *radius > 0.0);
    let (low, high) = (radii().fold(f64::INFINITY, f64::min), radii().fold(0.0, f64::max));
    if high > 0.0 {
        found.fact("radius_mm", vec![low, high], format!("{} to {}", length(low), length(high)));
    }
    let text = format!("{} x {} x {}", length(extent.x), length(extent.y), length(extent.z));
    found.fact("extent_mm", extent.to_array().to_vec(), text);
}

fn advise(traced: &Traced, found: &mut Findings) {
    let n_roots = n_roots(traced);
    if n_roots > 1 {
        let message = format!("there are {n_roots} roots: several trees in one file");
        found.advise("W-DOCTOR-ROOTS", message, "tree.components says which stay, or how they are joined");
    }
    let n_zero = traced.nodes.iter().filter(|node| node.radius_mm == 0.0).count();
    if n_zero > 0 {
        let message = format!("{n_zero} of {} nodes have no radius", traced.nodes.len());
        found.advise(
            "W-DOCTOR-RADII",
            message,
            "they get that of their neighbours, or a small one where none has any",
        );
    }
}

/// Here it is said of every tree whose unit is a guess; a run says it only of one that is too large.
fn advise_on_unit(tree: &Tree, largest_mm: f64, found: &mut Findings) {
    let message = format!("the file states no unit: taken as µm, it is {} across", length(largest_mm));
    let way_out = match steps::too_large_for_a_neuron(tree) {
        Some(size) => format!(
            "{size} is more than neurons are: --set input.unit=nm, or mm for vessels and airways; input.scale for voxels"
        ),
        None => "--set input.unit=um says so, or nm, or mm; input.scale for pixels and slices".to_owned(),
    };
    found.advise("W-SWC-UNIT", message, way_out);
}

fn n_roots(traced: &Traced) -> usize {
    traced.nodes.iter().filter(|node| node.parent.is_none()).count()
}

fn extent_mm(traced: &Traced) -> DVec3 {
    let points = || traced.nodes.iter().map(|node| node.position_mm);
    points().fold(DVec3::NEG_INFINITY, DVec3::max) - points().fold(DVec3::INFINITY, DVec3::min)
}

fn length(length_mm: f64) -> String {
    match length_mm {
        mm if mm >= 1.0 => format!("{mm:.1} mm"),
        mm => format!("{:.2} µm", mm * 1000.0),
    }
}
