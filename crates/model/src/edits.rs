//! Manual edits of a planar embedding: `edits.json`.
//!
//! ```json
//! {
//!   "format": "espalier-edits",
//!   "version": 1,
//!   "tree": "the digest of the tree, as in embedding.json",
//!   "edits": [
//!     { "branch": 7, "node": 41, "angle_deg": 35.0 }
//!   ]
//! }
//! ```
//!
//! An edit rotates a branch from one of its nodes on, with all that hangs from there, and pins what of the branch it
//! has rotated. Numbers of branches and nodes are those of `nodes.tsv`; edits are counted from 0, as in a list.

use serde::{Deserialize, Serialize};
use serde_json::value::RawValue;
use thiserror::Error;

use crate::diagnose::{Class, Diagnose};
use crate::tree::{Branches, Tree};
use crate::versioned::{self, FileError};

pub(crate) const FORMAT: &str = "espalier-edits";
const VERSION: u32 = 1;
/// More than a whole turn either way is a slip of the pen.
const LARGEST_DEG: f64 = 360.0;

/// One edit: a branch, or the part of it beyond a node, is turned about that node, and pinned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Edit {
    /// The branch.
    pub branch: usize,
    /// The node about which it turns: the fork (or root) that the branch hangs from, or a node on its way.
    pub node: usize,
    /// By how much, in degrees counter-clockwise in the picture, from −360 to 360; 0 only pins.
    pub angle_deg: f64,
}

/// The edits of one tree's embedding, in order.
///
/// **Guarantees** each names a branch of the tree, a node of it that is not its last, and a legal angle.
#[derive(Clone, Debug, PartialEq)]
pub struct Edits {
    tree: String,
    list: Vec<Edit>,
}

/// Why an edit cannot be made.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum EditError {
    /// A branch that the tree does not have.
    #[error("edits[{edit}]: there is no branch {branch}: {}", legal_branches(*n_branches))]
    NoSuchBranch {
        /// The edit, from 0.
        edit: usize,
        /// The branch it names.
        branch: usize,
        /// How many branches the tree has.
        n_branches: usize,
    },
    /// A node that the branch cannot turn about.
    #[error(
        "edits[{edit}]: branch {branch} cannot turn about node {node}, only about {}",
        legal_nodes(*hub, *first, *last)
    )]
    NoSuchNode {
        /// The edit, from 0.
        edit: usize,
        /// The branch it names.
        branch: usize,
        /// The node it names.
        node: usize,
        /// The fork or root that the branch hangs from.
        hub: usize,
        /// The first node of the branch.
        first: usize,
        /// The last node of the branch, beyond which there is nothing to turn.
        last: usize,
    },
    /// An angle that is none.
    #[error("edits[{edit}]: angle_deg of branch {branch} must be from -360 to 360, is {angle_deg}")]
    Angle {
        /// The edit, from 0.
        edit: usize,
        /// The branch it names.
        branch: usize,
        /// The angle.
        angle_deg: f64,
    },
}

fn legal_branches(n_branches: usize) -> String {
    match n_branches {
        0 => "the tree has none".to_owned(),
        _ => format!("they are 0 to {}", n_branches - 1),
    }
}

fn legal_nodes(hub: usize, first: usize, last: usize) -> String {
    match last - first {
        0 => format!("node {hub}"),
        1 => format!("nodes {hub} and {first}"),
        _ => format!("nodes {hub} and {first} to {}", last - 1),
    }
}

impl EditError {
    /// The edit that it is about, from 0.
    #[must_use]
    pub fn edit(&self) -> usize {
        match *self {
            Self::NoSuchBranch { edit, .. } | Self::NoSuchNode { edit, .. } | Self::Angle { edit, .. } => {
                edit
            }
        }
    }
}

impl Diagnose for EditError {
    fn code(&self) -> &'static str {
        "E-EDITS"
    }

    fn class(&self) -> Class {
        Class::Input
    }
}

impl Edits {
    /// Edits of the embedding of `tree`.
    ///
    /// # Errors
    /// [`EditError`] for the first edit that cannot be made.
    ///
    /// ```
    /// use espalier_model::{Edit, Edits, Node, Tree};
    /// use glam::DVec3;
    /// let node = |z: f64, parent| Node { position_mm: DVec3::new(0.0, 0.0, z), radius_mm: 0.5, parent, kind: 3 };
    /// let tree = Tree::new(&[node(0.0, None), node(1.0, Some(0)), node(2.0, Some(1))])?;
    /// let edits = Edits::new(&tree, vec![Edit { branch: 0, node: 1, angle_deg: 30.0 }])?;
    /// assert_eq!(Edits::from_json(&edits.to_json(), &tree).unwrap(), edits);
    /// let error = Edits::new(&tree, vec![Edit { branch: 1, node: 1, angle_deg: 30.0 }]).unwrap_err();
    /// assert_eq!(error.to_string(), "edits[0]: there is no branch 1: they are 0 to 0");
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn new(tree: &Tree, list: Vec<Edit>) -> Result<Self, EditError> {
        let branches = tree.branches();
        list.iter().enumerate().try_for_each(|(idx, edit)| check(&branches, idx, edit))?;
        Ok(Self { tree: tree.digest(), list })
    }

    /// No edits.
    #[must_use]
    pub fn none(tree: &Tree) -> Self {
        Self { tree: tree.digest(), list: Vec::new() }
    }

    /// The digest of the tree that they are for.
    #[must_use]
    pub fn tree(&self) -> &str {
        &self.tree
    }

    /// The edits, in the order in which they are made.
    #[must_use]
    pub fn list(&self) -> &[Edit] {
        &self.list
    }

    /// The text of `edits.json`.
    #[must_use]
    pub fn to_json(&self) -> String {
        let file = EditFile::of;
        let body = EditsBody { tree: self.tree.clone(), edits: self.list.iter().map(file).collect() };
        versioned::to_json(FORMAT, VERSION, body)
    }

    /// The edits of the embedding of `tree` in a text of `edits.json`.
    ///
    /// # Errors
    /// [`FileError`], with the line, if the text is not such a file, was made for another tree, or has an edit that
    /// cannot be made.
    pub fn from_json(text: &str, tree: &Tree) -> Result<Self, FileError> {
        versioned::check_head(FORMAT, VERSION, text)?;
        let malformed = |source| FileError::Malformed { format: FORMAT, source };
        let file: EditsFile<'_> = serde_json::from_str(text).map_err(malformed)?;
        versioned::check_tree(FORMAT, &file.tree, tree)?;
        let at = |idx: usize, what: &str| {
            let line = line_of(text, file.edits[idx].get());
            FileError::Invalid { format: FORMAT, what: format!("line {line}: {what}") }
        };
        let mut list = Vec::with_capacity(file.edits.len());
        for (idx, raw) in file.edits.iter().enumerate() {
            let edit: EditFile = serde_json::from_str(raw.get())
                .map_err(|error| at(idx, &format!("edits[{idx}]: {}", without_place(&error))))?;
            list.push(Edit { branch: edit.branch, node: edit.node, angle_deg: edit.angle_deg });
        }
        Self::new(tree, list).map_err(|error| at(error.edit(), &error.to_string()))
    }
}

fn check(branches: &Branches, idx: usize, edit: &Edit) -> Result<(), EditError> {
    let Edit { branch, node, angle_deg } = *edit;
    let n_branches = branches.list().len();
    let Some(way) = branches.list().get(branch) else {
        return Err(EditError::NoSuchBranch { edit: idx, branch, n_branches });
    };
    if node != way.hub && !(way.nodes.start..way.end()).contains(&node) {
        let (hub, first, last) = (way.hub, way.nodes.start, way.end());
        return Err(EditError::NoSuchNode { edit: idx, branch, node, hub, first, last });
    }
    if !(-LARGEST_DEG..=LARGEST_DEG).contains(&angle_deg) {
        return Err(EditError::Angle { edit: idx, branch, angle_deg });
    }
    Ok(())
}

/// The line on which a part of a text begins, from 1.
fn line_of(text: &str, part: &str) -> usize {
    let start = (part.as_ptr() as usize).saturating_sub(text.as_ptr() as usize);
    text.as_bytes().iter().take(start).filter(|&&byte| byte == b'\n').count() + 1
}

/// The message of an error whose own line would be that of a part.
fn without_place(error: &serde_json::Error) -> String {
    let message = error.to_string();
    message.split(" at line ").next().unwrap_or_default().to_owned()
}

/// As written; the envelope has format and version.
#[derive(Serialize)]
struct EditsBody {
    tree: String,
    edits: Vec<EditFile>,
}

/// As read: every edit keeps its text, and so its line.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct EditsFile<'a> {
    #[serde(rename = "format")]
    _format: String,
    #[serde(rename = "version")]
    _version: u32,
    tree: String,
    #[serde(borrow)]
    edits: Vec<&'a RawValue>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct EditFile {
    branch: usize,
    node: usize,
    angle_deg: f64,
}

impl EditFile {
    fn of(edit: &Edit) -> Self {
        Self { branch: edit.branch, node: edit.node, angle_deg: edit.angle_deg }
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::tree::Node;

    /// A stem of two edges, then a branch of two and a branch of one.
    fn tree() -> Tree {
        let node =
            |x, y, parent| Node { position_mm: DVec3::new(x, y, 0.0), radius_mm: 1.0, parent, kind: 0 };
        Tree::new(&[
            node(0.0, 0.0, None),
            node(0.0, 1.0, Some(0)),
            node(0.0, 2.0, Some(1)),
            node(1.0, 2.0, Some(2)),
            node(2.0, 2.0, Some(3)),
            node(-1.0, 2.0, Some(2)),
        ])
        .expect("a tree")
    }

    fn text(edits: &str) -> String {
        let digest = tree().digest();
        format!(
            "{{\n\"format\": \"espalier-edits\", \"version\": 1,\n\"tree\": \"{digest}\",\n\"edits\": [\n{edits}\n]}}\n"
        )
    }

    #[track_caller]
    fn refused(text: &str, fragments: &[&str]) {
        let error = Edits::from_json(text, &tree()).expect_err("refused").to_string();
        for fragment in fragments {
            assert!(error.contains(fragment), "no {fragment:?} in: {error}");
        }
    }

    #[test]
    fn reads_what_people_write() {
        let text = text(
            "{ \"branch\": 1, \"node\": 2, \"angle_deg\": 30 },\n {\"node\":3,\"angle_deg\":-1.5e1,\"branch\":1}",
        );
        let edits = Edits::from_json(&text, &tree()).expect("edits");
        let expected =
            [Edit { branch: 1, node: 2, angle_deg: 30.0 }, Edit { branch: 1, node: 3, angle_deg: -15.0 }];
        assert_eq!(edits.list(), expected);
        assert_eq!(Edits::from_json(&edits.to_json(), &tree()).expect("our own file"), edits);
        assert_eq!(Edits::from_json(&Edits::none(&tree()).to_json(), &tree()).expect("none").list(), []);
    }

    #[test]
    fn what_is_wrong_is_named_with_its_line() {
        let good = "{\"branch\": 1, \"node\": 2, \"angle_deg\": 30},\n";
        let after = |bad: &str| text(&format!("{good}{bad}"));
        refused(
            &after("{\"branch\": 3, \"node\": 2, \"angle_deg\": 1}"),
            &["line 6: edits[1]: there is no branch 3: they are 0 to 2"],
        );
        refused(
            &after("{\"branch\": 1, \"node\": 4, \"angle_deg\": 1}"),
            &["line 6", "about node 4, only about nodes 2 and 3"],
        );
        refused(
            &after("{\"branch\": 2, \"node\": 5, \"angle_deg\": 1}"),
            &["about node 5, only about node 2"],
        );
        refused(
            &after("{\"branch\": 1, \"node\": 2, \"angle_deg\": 361}"),
            &["line 6", "branch 1 must be from -360 to 360, is 361"],
        );
        refused(
            &after("{\"branch\": 1, \"node\": 2, \"angle_deg\": 1e999}"),
            &["line 6", "number out of range"],
        );
        refused(&after("{\"branch\": 1, \"node\": 2, \"angle_deg\": NaN}"), &["line 6"]);
        refused(
            &after("{\"branch\": -1, \"node\": 2, \"angle_deg\": 1}"),
            &["line 6: edits[1]: invalid value: integer `-1`"],
        );
        refused(
            &after("{\"branch\": 1, \"node\": 2, \"angle\": 1}"),
            &["line 6: edits[1]: unknown field `angle`"],
        );
        refused(&after("{\"branch\": 1, \"node\": 2}"), &["line 6: edits[1]: missing field `angle_deg`"]);
        refused(&after("{\"branch\": 1,"), &["not a readable espalier-edits file", "line 7"]);
        refused(&text("").replace("\"edits\"", "\"edit\""), &["unknown field `edit`", "line 4"]);
        refused("", &["not a readable espalier-edits file"]);
        refused("[1, 2]", &["not a readable espalier-edits file"]);
        refused(&text("").replace("\"version\": 1", "\"version\": 9"), &["version 9"]);
        refused(&text("").replace("espalier-edits", "espalier-views"), &["format espalier-views"]);
    }

    #[test]
    fn another_tree_is_refused() {
        let other = Tree::new(&tree().nodes()[..5]).expect("a tree");
        let error = Edits::from_json(&text(""), &other).expect_err("refused");
        assert!(matches!(error, FileError::OtherTree { .. }), "{error}");
    }

    #[test]
    fn numbers_that_are_none() {
        for angle_deg in [f64::NAN, f64::INFINITY, -1e300] {
            let error =
                Edits::new(&tree(), vec![Edit { branch: 0, node: 1, angle_deg }]).expect_err("refused");
            assert!(matches!(error, EditError::Angle { edit: 0, branch: 0, .. }), "{error}");
        }
        let point = Tree::new(&tree().nodes()[..1]).expect("a tree");
        let error =
            Edits::new(&point, vec![Edit { branch: 0, node: 0, angle_deg: 1.0 }]).expect_err("refused");
        assert_eq!(error.to_string(), "edits[0]: there is no branch 0: the tree has none");
    }
}
