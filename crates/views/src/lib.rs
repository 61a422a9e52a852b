//! Views of a tree that lose least, and the planes of its parts.
//!
//! | step | file | in → out | source |
//! |--:|---|---|---|
//! | 1 | `enhanced` | tree → parts, each with its real and imaginary edges | [Hu2022] 3.1.1, 3.2.1 |
//! | 2 | `metric` | part, direction → what the view loses | [Hu2022] Eq. 1 |
//! | 3 | `frame` | direction → the side that faces the viewer, and up | ours |
//! | 4 | `objective` | part → what to minimise, and the answer for parts with many equally good views | ours |
//! | 5 | `search`, `swarm` | objective → best direction | textbook; [Hu2022] Eq. 5 |
//! | 6 | `hierarchy` | tree → global view, subtree views, planes | [Hu2022] 3.1.2, 3.2.1 |
//! | 7 | `headings` | planes → where each edge heads when the angles are strung together | [Hu2022] 3.2.1 |
//! | 8 | `mirror` | planes → planes whose mirror is chosen | ours |
//! | 9 | `recovery` | planes → how well they show the tree's angles | |
//!
//! **Spaces** positions are RAS+ mm; a view is orthographic, its picture has x to the right and y up.
//!
//! Keys such as [Hu2022] resolve in `REFERENCES.md`.

mod enhanced;
mod error;
mod frame;
mod headings;
mod hierarchy;
mod metric;
mod mirror;
mod objective;
mod params;
mod recovery;
mod search;
mod swarm;

use espalier_model::{Report, Tree, ViewHierarchy};

pub use error::Error;
pub use params::{Metric, Mirror, Params, Search};

/// The views of a tree and how they were found.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// The global view, the subtree views, the planes.
    pub hierarchy: ViewHierarchy,
    /// Counts: `evaluations`, `subtree_views`, `chains`, `chains_mirrored`, `forks`, `forks_mirrored`,
    /// `global_loss`, `global_camera_distance_mm`, `heading_mismatch`, `chain_angle_error_mean_deg`,
    /// `fork_angle_error_mean_deg`.
    pub report: Report,
}

/// The largest coordinate allowed, in mm: squares and cubes of it stay far inside the range of `f64`.
const MAX_COORDINATE_MM: f64 = 1e90;

/// Finds the views of a tree: sections 3.1 and 3.2.1 of [Hu2022].
///
/// The seed matters for [`Search::Pso`] only. The result does not depend on the number of threads.
///
/// # Errors
/// [`Error::Param`] for a parameter outside its range, [`Error::TooFar`] for coordinates beyond 1e90 mm.
///
/// ```
/// use espalier_model::{Node, Tree};
/// use espalier_views::{Params, find_views};
/// use glam::DVec3;
///
/// let node = |x, z, parent| Node { position_mm: DVec3::new(x, 0.0, z), radius_mm: 1.0, parent, kind: 0 };
/// let fork = [node(0.0, 9.0, None), node(0.0, 5.0, Some(0)), node(3.0, 0.0, Some(1)), node(-3.0, 0.0, Some(1))];
/// let tree = Tree::new(&fork)?;
/// let found = find_views(&tree, &Params::default(), 0)?;
/// assert!(found.hierarchy.global.towards_camera.distance(DVec3::Y) < 1e-3);
///
/// let blind = Params { directions: 0, ..Params::default() };
/// assert_eq!(
///     find_views(&tree, &blind, 0).unwrap_err().to_string(),
///     "directions: must be 8 to 100000, is 0"
/// );
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn find_views(tree: &Tree, params: &Params, seed: u64) -> Result<Found, Error> {
    params.validate()?;
    check_coordinates(tree)?;
    let branches = tree.branches();
    let (mut hierarchy, n_evaluations) = hierarchy::views_of_parts(tree, &branches, params, seed);
    mirror::choose_mirrors(tree, &branches, &mut hierarchy, params.mirror);

    let recovery = recovery::recovery(tree, &branches, &hierarchy);
    let forks = || hierarchy.forks.iter().flatten();
    let mut report = Report::default();
    report.count("evaluations", n_evaluations as f64);
    report.count_usize("subtree_views", hierarchy.subtrees.len());
    report.count_usize("chains", hierarchy.chains.len());
    report.count_usize("chains_mirrored", hierarchy.chains.iter().filter(|plane| plane.is_mirrored).count());
    report.count_usize("forks", forks().count());
    report.count_usize("forks_mirrored", forks().filter(|plane| plane.is_mirrored).count());
    report.count("global_loss", hierarchy.global.loss);
    report.count("global_camera_distance_mm", params.beta * hierarchy.global.radius_mm);
    report.count("heading_mismatch", headings::heading_mismatch(tree, &branches, &hierarchy));
    report.count("chain_angle_error_mean_deg", recovery.chain_error_mean_deg);
    report.count("fork_angle_error_mean_deg", recovery.fork_error_mean_deg);
    Ok(Found { hierarchy, report })
}

fn check_coordinates(tree: &Tree) -> Result<(), Error> {
    for (node, data) in tree.nodes().iter().enumerate() {
        let distance_mm = data.position_mm.abs().max_element();
        if distance_mm > MAX_COORDINATE_MM {
            return Err(Error::TooFar { node, distance_mm, limit_mm: MAX_COORDINATE_MM });
        }
    }
    Ok(())
}
