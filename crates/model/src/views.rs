//! Views of a tree, and the planes of its parts; their file `views.json`.
//!
//! **File** JSON, format `espalier-views` version 1: the digest of its tree, the space, the number of nodes, the
//! global view, the subtree views, one plane per branch, one plane per fork with its node. Numbers are written
//! with the fewest digits that read back as the same `f64`, so a file gives the very hierarchy it was written from.
//! A file is read for the tree it was made for, and for no other.

use glam::{DVec2, DVec3};
use serde::{Deserialize, Serialize};

use crate::tree::Tree;
use crate::versioned::{self, FileError};

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

impl View {
    /// Unit vector that is right in the picture, RAS+.
    #[must_use]
    pub fn right(&self) -> DVec3 {
        self.up.cross(self.towards_camera)
    }

    /// A vector of the world as the picture shows it: x to the right, y up, in the vector's own unit.
    #[must_use]
    pub fn project(&self, vector: DVec3) -> DVec2 {
        DVec2::new(vector.dot(self.right()), vector.dot(self.up))
    }
}

/// The best view of a subtree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SubtreeView {
    /// The branching depth: 0 for the whole tree, else the number of forks above `root`.
    pub level: u32,
    /// The node at whose subtree the view looks. Below level 0 the edge from its fork belongs to the subject.
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
    /// The digest of its tree: [`Tree::digest`].
    pub tree: String,
    /// The best view of the whole tree.
    pub global: View,
    /// The best view of each subtree below a branching node that branches again, level by level, in preorder
    /// within a level; the first is the whole tree at level 0.
    pub subtrees: Vec<SubtreeView>,
    /// The plane of each branch's chain set, by branch index.
    pub chains: Vec<LocalPlane>,
    /// The plane of each fork's branching set, by node index.
    pub forks: Vec<Option<LocalPlane>>,
}

impl ViewHierarchy {
    /// The file `views.json`.
    #[must_use]
    pub fn to_json(&self) -> String {
        let subtrees = self.subtrees.iter().map(|subtree| SubtreeRecord {
            level: subtree.level,
            root: subtree.root,
            view: ViewRecord::of(&subtree.view),
        });
        let forks =
            self.forks.iter().enumerate().filter_map(|(node, fork)| {
                fork.map(|plane| ForkRecord { node, plane: PlaneRecord::of(&plane) })
            });
        let file = ViewsFile {
            tree: self.tree.clone(),
            space: SPACE.to_owned(),
            n_nodes: self.forks.len(),
            global: ViewRecord::of(&self.global),
            subtrees: subtrees.collect(),
            chains: self.chains.iter().map(PlaneRecord::of).collect(),
            forks: forks.collect(),
        };
        versioned::to_json(FORMAT, VERSION, file)
    }

    /// The hierarchy of `tree` from its file.
    ///
    /// # Errors
    /// [`FileError`] if the text is no `views.json` of this version, was made for another tree, or breaks a
    /// guarantee.
    pub fn from_json(text: &str, tree: &Tree) -> Result<Self, FileError> {
        let file: ViewsFile = versioned::from_json(FORMAT, VERSION, text)?;
        versioned::check_tree(FORMAT, &file.tree, tree)?;
        file.check(tree).map_err(|what| FileError::Invalid { format: FORMAT, what })?;
        let subtrees = file.subtrees.iter().map(|record| SubtreeView {
            level: record.level,
            root: record.root,
            view: record.view.view(),
        });
        let mut forks = vec![None; file.n_nodes];
        for record in &file.forks {
            forks[record.node] = Some(record.plane.plane());
        }
        Ok(Self {
            tree: file.tree,
            global: file.global.view(),
            subtrees: subtrees.collect(),
            chains: file.chains.iter().map(PlaneRecord::plane).collect(),
            forks,
        })
    }
}

/// The two vectors of a view that a file gives: of the global view of a `views.json`, of whatever tree, or of JSON with
/// nothing but `towards_camera` and `up`, RAS+, of any length.
///
/// # Errors
/// [`FileError`] if the text is neither, or of another version, or if the vectors make no view.
pub fn view_axes_from_json(text: &str) -> Result<(DVec3, DVec3), FileError> {
    let has_format = serde_json::from_str::<NamedFormat>(text).is_ok_and(|named| named.format.is_some());
    let axes: ViewAxes = if has_format {
        let file: ViewsFile = versioned::from_json(FORMAT, VERSION, text)?;
        ViewAxes { towards_camera: file.global.towards_camera, up: file.global.up }
    } else {
        serde_json::from_str(text).map_err(|source| FileError::Malformed { format: VIEW_FORMAT, source })?
    };
    let vectors = [axes.towards_camera, axes.up].map(DVec3::from_array);
    for (name, vector) in ["towards_camera", "up"].into_iter().zip(vectors) {
        let is_vector = (1e-100..=1e100).contains(&vector.length());
        let what =
            || FileError::Invalid { format: VIEW_FORMAT, what: format!("{name} has no direction: {vector}") };
        is_vector.then_some(()).ok_or_else(what)?;
    }
    let [towards_camera, up] = vectors.map(DVec3::normalize);
    if towards_camera.cross(up).length() <= 1e-6 {
        let what = "up is along towards_camera".to_owned();
        return Err(FileError::Invalid { format: VIEW_FORMAT, what });
    }
    Ok((towards_camera, (up - up.dot(towards_camera) * towards_camera).normalize()))
}

/// Whether a file says what it is.
#[derive(Deserialize)]
struct NamedFormat {
    format: Option<serde_json::Value>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ViewAxes {
    towards_camera: [f64; 3],
    up: [f64; 3],
}

/// What a file of two vectors is called in messages.
pub(crate) const VIEW_FORMAT: &str = "view";

const FORMAT: &str = "espalier-views";
const VERSION: u32 = 1;
const SPACE: &str = "RAS+ mm";

/// How far from unit length and from the right angle the axes in a file may be: a few roundings.
const AXIS_TOLERANCE: f64 = 1e-9;

#[derive(Serialize, Deserialize)]
struct ViewsFile {
    tree: String,
    space: String,
    n_nodes: usize,
    global: ViewRecord,
    subtrees: Vec<SubtreeRecord>,
    chains: Vec<PlaneRecord>,
    forks: Vec<ForkRecord>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ViewRecord {
    towards_camera: [f64; 3],
    up: [f64; 3],
    center_mm: [f64; 3],
    radius_mm: f64,
    loss: f64,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SubtreeRecord {
    level: u32,
    root: usize,
    view: ViewRecord,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct PlaneRecord {
    is_mirrored: bool,
    view: ViewRecord,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ForkRecord {
    node: usize,
    plane: PlaneRecord,
}

impl ViewRecord {
    fn of(view: &View) -> Self {
        Self {
            towards_camera: view.towards_camera.to_array(),
            up: view.up.to_array(),
            center_mm: view.center_mm.to_array(),
            radius_mm: view.radius_mm,
            loss: view.loss,
        }
    }

    fn view(&self) -> View {
        View {
            towards_camera: DVec3::from_array(self.towards_camera),
            up: DVec3::from_array(self.up),
            center_mm: DVec3::from_array(self.center_mm),
            radius_mm: self.radius_mm,
            loss: self.loss,
        }
    }

    fn check(&self, place: &str) -> Result<(), String> {
        let View { towards_camera, up, center_mm, radius_mm, loss } = self.view();
        for (name, axis) in [("towards_camera", towards_camera), ("up", up)] {
            let is_unit = (axis.length() - 1.0).abs() <= AXIS_TOLERANCE;
            ensure(is_unit, || format!("{name} of {place} is {axis}, not a unit vector"))?;
        }
        let slant = up.dot(towards_camera).abs();
        ensure(slant <= AXIS_TOLERANCE, || format!("up of {place} is not perpendicular to towards_camera"))?;
        let is_placed =
            center_mm.is_finite() && radius_mm.is_finite() && radius_mm >= 0.0 && loss.is_finite();
        ensure(is_placed, || format!("{place} has centre {center_mm} mm, radius {radius_mm} mm, loss {loss}"))
    }
}

impl PlaneRecord {
    fn of(plane: &LocalPlane) -> Self {
        Self { is_mirrored: plane.is_mirrored, view: ViewRecord::of(&plane.view) }
    }

    fn plane(&self) -> LocalPlane {
        LocalPlane { is_mirrored: self.is_mirrored, view: self.view.view() }
    }
}

impl ViewsFile {
    /// Every guarantee of [`ViewHierarchy`] for `tree`, and sound numbers everywhere.
    fn check(&self, tree: &Tree) -> Result<(), String> {
        ensure(self.space == SPACE, || format!("space is {:?}, not {SPACE:?}", self.space))?;
        let n_nodes = tree.n_nodes();
        ensure(self.n_nodes == n_nodes, || {
            format!("made for {} nodes, the tree has {n_nodes}", self.n_nodes)
        })?;
        let n_branches = tree.branches().list().len();
        ensure(self.chains.len() == n_branches, || {
            format!("{} chains, the tree has {n_branches} branches", self.chains.len())
        })?;
        let fork_nodes = (0..n_nodes).filter(|&node| tree.children(node).len() > 1);
        ensure(self.forks.iter().map(|fork| fork.node).eq(fork_nodes), || {
            "the forks are not the tree's own, in order".to_owned()
        })?;
        self.check_subtrees(n_nodes)?;

        self.global.check("the global view")?;
        for (branch, chain) in self.chains.iter().enumerate() {
            chain.view.check(&format!("the plane of branch {branch}"))?;
        }
        for fork in &self.forks {
            fork.plane.view.check(&format!("the plane of fork {}", fork.node))?;
        }
        Ok(())
    }

    fn check_subtrees(&self, n_nodes: usize) -> Result<(), String> {
        let places: Vec<_> = self.subtrees.iter().map(|subtree| (subtree.level, subtree.root)).collect();
        ensure(places.first() == Some(&(0, 0)), || "the first subtree is not the whole tree".to_owned())?;
        for (subtree, record) in self.subtrees.iter().enumerate() {
            let is_in_order = subtree == 0 || places[subtree - 1] < places[subtree];
            ensure(is_in_order && record.root < n_nodes, || {
                let (level, root) = places[subtree];
                format!("subtree {subtree} (level {level}, root {root}) is out of order or outside the tree")
            })?;
            record.view.check(&format!("the view of subtree {subtree}"))?;
        }
        Ok(())
    }
}

fn ensure(holds: bool, what: impl FnOnce() -> String) -> Result<(), String> {
    if holds { Ok(()) } else { Err(what()) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tree::Node;

    fn fork_tree() -> Tree {
        let node = |x: f64, y: f64, parent| Node {
            position_mm: DVec3::new(x, y, 0.0),
            radius_mm: 1.0,
            parent,
            kind: 0,
        };
        Tree::new(&[
            node(0.0, 0.0, None),
            node(1.0, 0.0, Some(0)),
            node(2.0, 1.0, Some(1)),
            node(2.0, -1.0, Some(1)),
        ])
        .expect("a tree")
    }

    #[test]
    fn the_axes_of_a_view_come_from_either_file() {
        let of_hierarchy = view_axes_from_json(&sample().to_json()).expect("a view");
        assert!(of_hierarchy.0.distance(DVec3::new(0.6, 0.8, 0.0)) < 1e-15 && of_hierarchy.1 == DVec3::Z);
        let slanted =
            view_axes_from_json(r#"{"towards_camera": [0, 3, 0], "up": [0, 1, 2]}"#).expect("a view");
        assert!(slanted.0 == DVec3::Y && slanted.1.distance(DVec3::Z) < 1e-15, "{slanted:?}");
    }

    #[test]
    fn what_is_no_view_is_refused() {
        for (text, says) in [
            ("", "not a readable view file"),
            ("[]", "not a readable view file"),
            (r#"{"towards_camera": [0, 1, 0]}"#, "missing field `up`"),
            (r#"{"towards_camera": [0, 1], "up": [0, 0, 1]}"#, "not a readable view file"),
            (r#"{"towards_camera": [0, 1, 0], "up": [0, 0, 1], "fov": 3}"#, "unknown field `fov`"),
            (r#"{"towards_camera": [0, 1e999, 0], "up": [0, 0, 1]}"#, "not a readable view file"),
            (r#"{"towards_camera": [0, 0, 0], "up": [0, 0, 1]}"#, "towards_camera has no direction"),
            (r#"{"towards_camera": [1e200, 0, 0], "up": [0, 0, 1]}"#, "towards_camera has no direction"),
            (r#"{"towards_camera": [0, 0, 2], "up": [0, 0, -1]}"#, "up is along towards_camera"),
            (r#"{"format": "espalier-edits", "version": 1}"#, "format espalier-edits version 1"),
            (r#"{"format": "espalier-views", "version": 99}"#, "version 99"),
        ] {
            let error = view_axes_from_json(text).expect_err(text).to_string();
            assert!(error.contains(says), "{text}: {error}");
        }
    }

    fn sample() -> ViewHierarchy {
        let view = View {
            towards_camera: DVec3::new(0.6, 0.8, 0.0),
            up: DVec3::Z,
            center_mm: DVec3::new(0.1, 1.0 / 3.0, -1e-17),
            radius_mm: 2.0_f64.sqrt(),
            loss: 1e-300,
        };
        let plane = LocalPlane { view, is_mirrored: true };
        ViewHierarchy {
            tree: fork_tree().digest(),
            global: view,
            subtrees: vec![SubtreeView { level: 0, root: 0, view }],
            chains: vec![plane; 3],
            forks: vec![None, Some(LocalPlane { is_mirrored: false, ..plane }), None, None],
        }
    }

    #[test]
    fn file_gives_back_the_same_bits() {
        let read = ViewHierarchy::from_json(&sample().to_json(), &fork_tree()).expect("its own file");
        assert_eq!(read, sample());
    }

    #[test]
    fn file_that_breaks_a_guarantee_is_refused_with_the_place() {
        let broken = |change: fn(&mut ViewHierarchy)| {
            let mut views = sample();
            change(&mut views);
            ViewHierarchy::from_json(&views.to_json(), &fork_tree()).expect_err("refused").to_string()
        };
        type Change = fn(&mut ViewHierarchy);
        let cases: [(Change, &str); 8] = [
            (|v| v.chains.truncate(2), "2 chains, the tree has 3 branches"),
            (|v| v.forks[1] = None, "the forks are not the tree's own"),
            (|v| v.forks.push(None), "made for 5 nodes, the tree has 4"),
            (|v| v.subtrees.clear(), "the first subtree is not the whole tree"),
            (|v| v.subtrees.push(v.subtrees[0]), "subtree 1 (level 0, root 0) is out of order"),
            (|v| v.global.up = DVec3::X, "not perpendicular"),
            (|v| v.chains[2].view.towards_camera *= 1.01, "branch 2"),
            (|v| v.global.radius_mm = -1.0, "radius -1 mm"),
        ];
        for (change, expected) in cases {
            let message = broken(change);
            assert!(message.contains(expected), "{message} should say {expected}");
        }
    }

    #[test]
    fn other_files_are_refused() {
        let text = sample().to_json();
        for (from, to, expected) in [
            ("espalier-views", "espalier-embedding", "expected espalier-views version 1"),
            ("\"version\":1", "\"version\":2", "version 2"),
            ("RAS+ mm", "LPS+ mm", "LPS+ mm"),
            ("\"radius_mm\":", "\"radius_mm\":null,\"x\":", "not a readable"),
        ] {
            let other = text.replacen(from, to, 1);
            let message = ViewHierarchy::from_json(&other, &fork_tree()).expect_err("refused").to_string();
            assert!(message.contains(expected), "{message} should say {expected}");
        }
        assert!(ViewHierarchy::from_json("", &fork_tree()).is_err());
    }

    #[test]
    fn file_of_another_tree_of_the_same_shape_is_refused() {
        let mut nodes = fork_tree().nodes().to_vec();
        nodes[3].position_mm.x += 1e-12;
        let other = Tree::new(&nodes).expect("a tree");
        let error = ViewHierarchy::from_json(&sample().to_json(), &other).expect_err("refused");
        assert!(matches!(&error, FileError::OtherTree { expected, .. } if *expected == other.digest()));
        assert!(error.to_string().contains("was made for another tree"), "{error}");
    }

    #[test]
    fn front_view_has_the_patients_left_on_the_right() {
        let front = View { towards_camera: DVec3::Y, up: DVec3::Z, ..sample().global };
        assert_eq!(front.right(), DVec3::NEG_X);
        assert_eq!(front.project(DVec3::new(-2.0, 7.0, 3.0)), DVec2::new(2.0, 3.0));
    }
}
