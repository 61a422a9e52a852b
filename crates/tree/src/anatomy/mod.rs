//! Everything that is measured on a finished tree.
//!
//! | step | file |
//! |---|---|
//! | the polyline of a branch with its arc lengths | `line` |
//! | mean radius, taper, volume, surface | `calibre` |
//! | angles to parent and siblings | `angles` |
//! | branches of one generation together | `generations` |
//! | calibre along branches, its reference, areas of cross-sections | `profile`, `reference`, `areas` |
//! | narrow places | `stenosis` |
//! | the label map's region of each branch | `regions` |
//!
//! **Input** a [`Tree`]; of a mask, the spheres and the resolution; a label map if there is one. **Output** [`Anatomy`].
//! **Guarantees** a function of the tree alone; branch lengths sum up to the tree's; no recursion.
//! **Cost** O(N log N) for N nodes, and the samples of a label map.

mod angles;
mod areas;
mod calibre;
mod generations;
mod line;
mod profile;
mod reference;
mod regions;
mod stenosis;

use espalier_model::{Anatomy, BranchMeasures, Branches, InscribedSpheres, Tree};

use calibre::Calibre;
use line::Line;
pub use regions::LabelMap;

/// What is known beside the tree.
#[derive(Clone, Copy, Debug, Default)]
pub struct MeasureContext<'a> {
    /// The inscribed spheres that the tree was made from.
    pub spheres: Option<&'a InscribedSpheres>,
    /// What radii are known to, in mm: differences below are no narrowing. 0 for a traced tree.
    pub resolution_mm: f64,
    /// The least narrowing that is reported, in percent.
    pub stenosis_percent: f64,
    /// Regions that branches may lie in.
    pub labels: Option<&'a LabelMap>,
}

/// Measures a tree.
#[must_use]
pub fn measure(tree: &Tree, context: &MeasureContext<'_>) -> Anatomy {
    let branches = tree.branches();
    let lines: Vec<Line> = branches.list().iter().map(|branch| Line::of(tree, branch)).collect();
    let from_root_mm = path_lengths_mm(tree);
    let measured = measure_branches(tree, (&branches, &lines), &from_root_mm, context.labels);
    let reference = reference::of(tree, (&branches, &lines), &from_root_mm);
    let profile = profile::of(tree, (&branches, &lines), &from_root_mm, (&reference, context.spheres));
    let stenoses = stenosis::find(&lines, &reference, context.stenosis_percent, context.resolution_mm);
    Anatomy { generations: generations::summarise(&measured), branches: measured, profile, stenoses }
}

/// The path length from the root to each node, in mm.
fn path_lengths_mm(tree: &Tree) -> Vec<f64> {
    let mut lengths = vec![0.0; tree.n_nodes()];
    for (node, parent) in tree.edges() {
        lengths[node] = lengths[parent] + tree.edge_length_mm(node);
    }
    lengths
}

fn measure_branches(
    tree: &Tree,
    (branches, lines): (&Branches, &[Line]),
    from_root_mm: &[f64],
    labels: Option<&LabelMap>,
) -> Vec<BranchMeasures> {
    let angles = angles::of(tree, branches, lines);
    let calibres: Vec<Calibre> = lines.iter().map(Calibre::of).collect();
    let mut measured: Vec<BranchMeasures> = Vec::with_capacity(lines.len());
    for (branch_idx, (branch, line)) in branches.list().iter().zip(lines).enumerate() {
        let (calibre, end_node) = (&calibres[branch_idx], branch.end());
        let [start_mm, end_mm] = [tree.position_mm(branch.hub), tree.position_mm(end_node)];
        measured.push(BranchMeasures {
            branch: branch_idx,
            parent: branch.parent,
            children: Vec::new(),
            generation: branch.generation,
            strahler: branch.strahler,
            n_tips: usize::from(tree.children(end_node).is_empty()),
            start_node: branch.hub,
            end_node,
            start_mm,
            end_mm,
            start_from_root_mm: from_root_mm[branch.hub],
            length_mm: line.length_mm(),
            chord_mm: start_mm.distance(end_mm),
            radius_mean_mm: calibre.mean_mm,
            radius_min_mm: calibre.min_mm,
            radius_max_mm: calibre.max_mm,
            taper: calibre.taper,
            volume_mm3: calibre.volume_mm3,
            surface_mm2: calibre.surface_mm2,
            branching_angle_deg: angles[branch_idx].to_parent_deg,
            sibling_angle_deg: angles[branch_idx].to_sibling_deg,
            radius_to_parent: branch.parent.map_or(f64::NAN, |parent| calibre.ratio_to(&calibres[parent])),
            region: labels.and_then(|labels| labels.region_of(line)),
            n_voxels: None,
            mask_volume_mm3: f64::NAN,
        });
    }
    count_families(&mut measured);
    measured
}

/// Fills in children, and tips of whole subtrees from those of the branches themselves.
fn count_families(measured: &mut [BranchMeasures]) {
    for branch_idx in 0..measured.len() {
        if let Some(parent) = measured[branch_idx].parent {
            measured[parent].children.push(branch_idx);
        }
    }
    // Branches stand in preorder: backwards, every subtree is complete before its parent asks for it.
    for branch_idx in (0..measured.len()).rev() {
        if let Some(parent) = measured[branch_idx].parent {
            measured[parent].n_tips += measured[branch_idx].n_tips;
        }
    }
}

#[cfg(test)]
mod tests;
