//! Views of a tree, and the planes of its parts.

use glam::DVec3;

/// An orthographic view of a set of edges.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Unit vector from the subject towards the camera, RAS+. The plane of the view is perpendicular to it.
    pub towards_camera: DVec3,
    /// Unit vector that is up in the picture, perpendicular to `towards_camera`; right is `up × towards_camera`.
    pub up: DVec3,
    /// The length-weighted centroid of the subject, RAS+ mm: what the camera looks at.
    pub center_mm: DVec3,
    /// The expansion radius of the subject about the centre, in mm.
    pub radius_mm: f64,
    /// The loss of the view metric: 0 if nothing is lost.
    pub loss: f64,
}

/// The best view of a subtree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SubtreeView {
    /// The branching depth: 0 for the whole tree.
    pub level: u32,
    /// The node at whose subtree the view looks.
    pub root: usize,
    /// The view.
    pub view: View,
}

/// The principal plane of a chain or of a branching set (section 3.2.1 of [Hu2022]), its mirror chosen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LocalPlane {
    /// Its view. `towards_camera` already holds the mirror: angles are counter-clockwise as seen from there.
    pub view: View,
    /// Whether the closed loop turned the plane over, against the side that faces the global view's camera.
    pub is_mirrored: bool,
}

/// Everything that the `views` stage knows about a tree.
///
/// **Guarantees** made for one tree: `chains` has one plane for each of its branches, `forks` one entry for each
/// node, which is `Some` exactly where the node has two or more children.
#[derive(Clone, Debug, PartialEq)]
pub struct ViewHierarchy {
    /// The best view of the whole tree.
    pub global: View,
    /// The best view of each subtree below a branching node, level by level, in preorder within a level; the
    /// first is the whole tree at level 0.
    pub subtrees: Vec<SubtreeView>,
    /// The plane of each branch's chain set, by branch index.
    pub chains: Vec<LocalPlane>,
    /// The plane of each fork's branching set, by node index.
    pub forks: Vec<Option<LocalPlane>>,
}
