//! What is known about a phantom without measuring it.

use espalier_model::Tree;
use glam::DVec3;

/// Facts about a phantom. Closed-form where the body has one; otherwise as its ground-truth tree has them.
#[derive(Clone, Debug, PartialEq)]
pub struct Truth {
    /// Length of the centreline in mm, between the centres of the rounded ends: the ends' caps reach further,
    /// by the radius there. For curves the arc's own length, which the tree's chords miss by a little; a ring
    /// counts as a whole, though its tree is opened.
    pub length_mm: f64,
    /// Volume of the body in mm³, caps included, where it has a closed form.
    pub volume_mm3: Option<f64>,
    /// By how much a bent tube turns, in degrees; 0 is straight on.
    pub bend_angle_deg: Option<f64>,
    /// Angle between the two branches of a Y in degrees.
    pub branch_angle_deg: Option<f64>,
    /// Smallest and largest radius in mm.
    pub radius_range_mm: [f64; 2],
    /// Tips of the tree, the root apart.
    pub n_tips: usize,
    /// Loops of the body: 1 for a torus.
    pub n_loops: usize,
    /// How to segment its CT; `None` if it has none.
    pub segmentation: Option<Segmentation>,
}

/// A way to segment the CT of a phantom by region growing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segmentation {
    /// A point well inside the lumen, RAS+ mm.
    pub seed_mm: DVec3,
    /// The band of HU to grow in, both ends included, at the default noise and blur.
    pub band_hu: [f64; 2],
}

impl Truth {
    /// The facts of a grown tree.
    pub(crate) fn of_tree(tree: &Tree) -> Self {
        let radii = || tree.nodes().iter().map(|node| node.radius_mm);
        Self {
            length_mm: tree.length_mm(),
            volume_mm3: None,
            bend_angle_deg: None,
            branch_angle_deg: None,
            radius_range_mm: [radii().fold(f64::INFINITY, f64::min), radii().fold(0.0, f64::max)],
            n_tips: tree.n_tips(),
            n_loops: 0,
            segmentation: None,
        }
    }
}
