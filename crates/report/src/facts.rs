//! What the caller knows of a run, as values: the page reads no file.

use espalier_model::{Comparison, Embedding, Ledger, Mask, Tree, ViewHierarchy};

use crate::params::Params;
use crate::rows::Rows;
use crate::slices::Slices;

/// What the run began with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InputKind {
    /// A scan, a label map or a mask.
    Volume,
    /// A traced tree.
    Tree,
    /// A phantom with a scan.
    PhantomScan,
    /// A phantom that is traced at once.
    PhantomTree,
}

/// A file that the run was made from: its content, never its name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct InputFile {
    /// What it is for.
    pub role: String,
    /// Its size.
    pub n_bytes: String,
    /// The SHA-256 of its content.
    pub sha256: String,
}

/// What a stage has said of itself.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StageFacts {
    /// Its name.
    pub stage: String,
    /// What it counted.
    pub counts: Vec<(String, f64)>,
    /// Its warnings: code and message.
    pub warnings: Vec<(String, String)>,
}

/// A setting of the run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Setting {
    /// Its dotted key.
    pub key: String,
    /// Its value.
    pub value: String,
    /// The value that it has when nobody says; none where there is no such value.
    pub default: Option<String>,
}

impl Setting {
    /// Whether somebody has said otherwise.
    #[must_use]
    pub fn is_changed(&self) -> bool {
        self.default.as_ref() != Some(&self.value)
    }
}

/// Colours by node, and what they mean.
#[derive(Clone, Debug, PartialEq)]
pub struct Coloring {
    /// A word for it, letters and hyphens: it becomes part of names in the page.
    pub key: &'static str,
    /// What it is called in the menu.
    pub name: String,
    /// What the scale says.
    pub caption: String,
    /// The colours on a light page, from the least value to the largest, sRGB.
    pub light: Vec<[u8; 3]>,
    /// The same on a dark page; as many.
    pub dark: Vec<[u8; 3]>,
    /// By node: the index of the colour of its edge.
    pub bins: Vec<u8>,
    /// Marks of the scale: where, from 0 to 1, and what they say.
    pub ticks: Vec<(f64, String)>,
}

/// Everything that the page is made from. What is `None` or empty is not there, and the page says so.
#[derive(Clone, Debug)]
pub struct Facts<'a> {
    /// The name of the run; none where it may be a patient's.
    pub name: Option<&'a str>,
    /// The program with its version.
    pub program: &'a str,
    /// The seed of the run.
    pub seed: u64,
    /// What the run began with.
    pub input_kind: InputKind,
    /// The files that it was made from.
    pub input_files: Vec<InputFile>,
    /// The slices of the scan that the mask was made from.
    pub slices: Option<Slices>,
    /// The mask.
    pub mask: Option<&'a Mask>,
    /// The tree.
    pub tree: &'a Tree,
    /// Its views.
    pub views: &'a ViewHierarchy,
    /// What was cut, pruned, dropped or joined.
    pub ledger: Option<&'a Ledger>,
    /// Its planar embedding.
    pub embedding: &'a Embedding,
    /// The layouts of all methods.
    pub comparison: Option<&'a Comparison>,
    /// `branches.tsv`.
    pub branches: Option<Rows>,
    /// `generations.tsv`.
    pub generations: Option<Rows>,
    /// `stenoses.tsv`.
    pub stenoses: Option<Rows>,
    /// `dictionary.tsv`.
    pub dictionary: Option<Rows>,
    /// The figure of the organ in space beside its map, as PNG.
    pub space_png: Option<Vec<u8>>,
    /// The colours of the map; the first is shown first.
    pub colorings: Vec<Coloring>,
    /// What each stage said, in their order.
    pub stages: Vec<StageFacts>,
    /// The settings of the stages that ran.
    pub settings: Vec<Setting>,
    /// One digest of all results that the page is made from.
    pub results_sha256: String,
}

impl Facts<'_> {
    /// The heading of the page.
    pub(crate) fn title(&self, params: &Params) -> String {
        let named = params.title.as_deref().filter(|title| !title.trim().is_empty());
        named.or(self.name).unwrap_or("Planar map of a tree").to_owned()
    }

    /// A count of a stage.
    pub(crate) fn count(&self, stage: &str, name: &str) -> Option<f64> {
        let stage = self.stages.iter().find(|facts| facts.stage == stage)?;
        stage.counts.iter().find(|(known, _)| known == name).map(|(_, value)| *value)
    }

    /// The value of a setting.
    pub(crate) fn setting(&self, key: &str) -> Option<&str> {
        self.settings.iter().find(|setting| setting.key == key).map(|setting| setting.value.trim_matches('"'))
    }

    /// Whether the tree was made from a scan or a mask.
    pub(crate) fn is_of_scan(&self) -> bool {
        self.mask.is_some() || matches!(self.input_kind, InputKind::Volume | InputKind::PhantomScan)
    }
}
