//! Skeleton voxels and inscribed spheres in, one rooted tree out; also: a traced structure in, one rooted tree out.
//!
//! | step | file | what happens |
//! |--:|---|---|
//! | 1 | `adjacency`, `graph` | 26-neighbours; junction clusters become one hub, chains become pieces |
//! | 2 | `components`, `bridges`, `nearest` | the largest component is the tree; short gaps to islands are bridged |
//! | 3 | `loops` | every loop is opened at its thinnest place |
//! | 4 | `living`, `prune`, `redundant`, `lumen`, `root` | spurs go, the root is chosen |
//! | 5 | `outline` | lines between root, forks and tips |
//! | 6 | `forks` | forks move to where the branches' axes meet |
//! | 7 | `tips` | free ends are set where the organ ends |
//! | 8 | `smooth` | the voxel staircase goes |
//! | 9 | `merge`, `resample` | nodes where the shape changes |
//! | 10 | `anatomy` | **[`measure`]**: length, calibre, angles, order of each branch; narrow places |
//! | 11 | `ownership` | **[`branch_voxels`]**: the branch of each voxel of the mask |
//! | – | `traced` | roots, duplicates and radii of a traced structure |
//!
//! Whatever is cut, pruned, dropped, extended or merged stands in the ledger with place, radius, length and reason.
//!
//! ```
//! use espalier_model::swc::{Traced, TracedNode};
//! use espalier_tree::{Params, Roots, from_traced};
//! let node = |id, x, parent| TracedNode {
//!     id, kind: 0, position_mm: glam::DVec3::new(x, 0.0, 0.0), radius_mm: 1.0, parent, line: id as usize,
//! };
//! let traced = Traced { nodes: vec![node(1, 0.0, None), node(2, 5.0, Some(0)), node(3, 9.0, None)] };
//! let built = from_traced(&traced, &Params::default())?;
//! assert_eq!((built.tree.n_nodes(), built.ledger.0.len()), (2, 1));
//! assert!(from_traced(&traced, &Params { roots: Roots::Refuse, ..Params::default() }).is_err());
//! # Ok::<(), espalier_tree::Error>(())
//! ```
//!
//! **Limits** The centres of inscribed spheres cut a sharp corner, at a right angle by 0.26 radii, and nothing here puts it
//! back: with legs of 6 radii, on slices as thick as half a radius, a right angle came out 2.9 % short. Lengths are
//! good to 1 % for corners of legs of about 12 radii or more, and for round bends of 3 radii.
//!
//! **Guarantees** same input and parameters, same tree; no recursion; ties go to the lower index, hence to storage order.

mod adjacency;
mod anatomy;
mod bridges;
mod components;
mod curve;
mod error;
mod forks;
mod graph;
mod living;
mod loops;
mod lumen;
mod mask_walk;
mod merge;
mod nearest;
mod outline;
mod ownership;
mod params;
mod polylines;
mod prune;
mod redundant;
mod resample;
mod root;
mod smooth;
mod summary;
mod tips;
mod traced;
mod wall;

use espalier_model::swc::Traced;
use espalier_model::{InscribedSpheres, Ledger, LedgerEntry, LedgerKind, Mask, Node, Report, Skeleton, Tree};
use glam::DVec3;

pub use anatomy::{LabelMap, MeasureContext, measure};
pub use error::Error;
pub use ownership::branch_voxels;
pub use params::{Components, Loops, MissingRadii, Params, Resample, Root, Roots, Tips};
pub use polylines::join_lines;

/// Branches shorter than this share of the smallest spacing are shorter than voxels can tell.
const RESOLUTION: f64 = 0.2;

/// A tree, what was done to get it, and its figures.
#[derive(Clone, Debug, PartialEq)]
pub struct Built {
    /// The tree, RAS+ mm.
    pub tree: Tree,
    /// Everything cut, pruned, dropped, extended, merged or repaired.
    pub ledger: Ledger,
    /// Counts and warnings.
    pub report: Report,
}

/// Builds the tree of a skeleton.
///
/// `mask`, `skeleton` and `spheres` belong together: one grid, one sphere for each skeleton voxel, in its order.
///
/// # Errors
/// [`Error`] if the skeleton is empty, the three do not belong together, a parameter is outside its range, or the
/// topology is refused by policy.
pub fn build(
    mask: &Mask,
    skeleton: &Skeleton,
    spheres: &InscribedSpheres,
    params: &Params,
) -> Result<Built, Error> {
    params.validate()?;
    check_input(mask, skeleton, spheres)?;
    let (mut ledger, mut report) = (Ledger::default(), Report::default());
    report.count_usize("skeleton_voxels", skeleton.voxels().len());

    // Topology: one component, no loops, no spurs, a root.
    let voxel_graph = graph::of_voxels(&adjacency::Adjacency::of(skeleton), spheres);
    let mut graph = components::select(voxel_graph, params, &mut ledger, &mut report)?;
    loops::open(&mut graph, params, &mut ledger)?;
    let mut living = living::Living::new(&graph);
    let protection = root::protected_tips(&mut living, params);
    prune::prune(&mut living, &protection, (mask, params), &mut ledger);
    let choice = root::choose(&living, params);
    root::describe(&choice, &living, params, (&mut ledger, &mut report));

    // Geometry: forks and tips where they belong, the staircase smoothed away.
    let mut outline = outline::trace(&living, choice.root);
    smooth::space_evenly(&mut outline, mask.grid());
    report.count("forks_moved_mean_mm", forks::relocate(&mut outline, mask));
    smooth::space_evenly(&mut outline, mask.grid());
    tips::set(&mut outline, mask, params.tips, &mut ledger);
    smooth::space_evenly(&mut outline, mask.grid());
    smooth::smooth(&mut outline, mask.grid(), params.smooth_voxels);
    forks::clear_spheres(&mut outline);
    // Where a line turns back at the border, moved forks and the smoothing kernel may lead it out.
    for sample in outline.lines.iter_mut().flat_map(|line| &mut line.samples) {
        sample.position_mm = mask_walk::in_scan(mask.grid(), sample.position_mm);
    }

    let resolution_mm = RESOLUTION * mask.grid().spacing_mm().min_element();
    let mut nodes = merge::merge_near(&outline_nodes(&outline, resolution_mm, &mut ledger), &mut ledger);
    wall::widen(&mut nodes, spheres);
    let kind = if params.resample == Resample::Auto { Resample::Shape } else { params.resample };
    finish(&nodes, kind, params, ledger, report)
}

/// Makes one rooted tree of a traced structure.
///
/// # Errors
/// [`Error`] if there is no node, a parameter is outside its range, or several roots are refused by policy.
pub fn from_traced(traced: &Traced, params: &Params) -> Result<Built, Error> {
    params.validate()?;
    let (mut ledger, mut report) = (Ledger::default(), Report::default());
    report.count_usize("traced_nodes", traced.nodes.len());
    let (nodes, n_roots) = traced::single_tree(traced, params, &mut ledger)?;
    report.count_usize("traced_roots", n_roots);
    let kind = if params.resample == Resample::Auto { Resample::None } else { params.resample };
    finish(&nodes, kind, params, ledger, report)
}

fn check_input(mask: &Mask, skeleton: &Skeleton, spheres: &InscribedSpheres) -> Result<(), Error> {
    let (n_voxels, n_spheres) = (skeleton.voxels().len(), spheres.0.len());
    if mask.grid() != skeleton.grid() {
        return Err(Error::Grids { mask: mask.grid().shape(), skeleton: skeleton.grid().shape() });
    }
    if n_voxels == 0 {
        return Err(Error::EmptySkeleton { n_foreground: mask.n_foreground() });
    }
    if n_voxels != n_spheres {
        return Err(Error::SphereCount { n_voxels, n_spheres });
    }
    let voxel_from_world = mask.grid().voxel_from_world();
    let beyond = DVec3::from_array(mask.grid().shape().map(|extent| extent as f64));
    for (voxel, sphere) in spheres.0.iter().enumerate() {
        let (center_mm, radius_mm) = (sphere.center_mm, sphere.radius_mm);
        let center_voxel = voxel_from_world.transform_point3(center_mm);
        let is_near_grid = center_voxel.cmpge(DVec3::NEG_ONE).all() && center_voxel.cmple(beyond).all();
        if !is_near_grid || !radius_mm.is_finite() || radius_mm < 0.0 {
            return Err(Error::BadSphere { voxel, center_mm, radius_mm });
        }
    }
    Ok(())
}

/// The nodes of an outline, parents first, as dense as its samples; forks nearer to each other than
/// `resolution_mm` are one.
fn outline_nodes(outline: &outline::Outline, resolution_mm: f64, ledger: &mut Ledger) -> Vec<Node> {
    let node = |sample: graph::Sample, parent: Option<usize>| Node {
        position_mm: sample.position_mm,
        radius_mm: sample.radius_mm,
        parent,
        kind: 0,
    };
    let mut nodes = vec![node(outline.hubs[0].sample, None)];
    let mut node_of_hub = vec![0; outline.hubs.len()];
    for line in &outline.lines {
        let mut parent = node_of_hub[line.from];
        let length_mm = graph::polyline_length_mm(&line.samples);
        if length_mm <= resolution_mm && outline.lines.len() > 1 {
            let end = outline.hubs[line.to].sample;
            ledger.0.push(LedgerEntry {
                kind: LedgerKind::NodesMerged,
                position_mm: end.position_mm,
                radius_mm: end.radius_mm,
                length_mm,
                reason: format!("branch of {length_mm:.3e} mm, not longer than {resolution_mm:.3e} mm"),
            });
        } else {
            for &sample in &line.samples[1..] {
                nodes.push(node(sample, Some(parent)));
                parent = nodes.len() - 1;
            }
        }
        node_of_hub[line.to] = parent;
    }
    nodes
}

/// Resamples, and describes the result.
fn finish(
    nodes: &[Node],
    kind: Resample,
    params: &Params,
    mut ledger: Ledger,
    mut report: Report,
) -> Result<Built, Error> {
    let dense = Tree::new(nodes)?;
    let tree = Tree::new(&resample::resample(&dense, kind, params, &mut ledger))?;
    summary::describe(&tree, &ledger, &mut report);
    Ok(Built { tree, ledger, report })
}
