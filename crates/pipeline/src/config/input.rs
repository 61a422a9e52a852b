//! `[input]`: where a run begins.

use std::path::{Path, PathBuf};

use espalier_model::diagnose::ParamError;
use espalier_model::swc::SwcScale;
use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The variable that may begin a path, for data that lies elsewhere on every machine.
pub(crate) const DATA_VARIABLE: &str = "$ESPALIER_DATA";

/// What kind of thing the input is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum InputKind {
    /// By its name: `.swc`, `.vtp` and `.vtk` are trees, all else a volume.
    #[default]
    Auto,
    /// A volume: CT, label map or mask; `[volume]` says how it becomes a mask.
    Volume,
    /// A traced tree: SWC, or polylines of VTK.
    Tree,
}

/// A unit of length.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Unit {
    /// By the header of a volume; µm for a traced tree, mm if espalier wrote it or if it is of VTK.
    #[default]
    Auto,
    /// Millimetres.
    Mm,
    /// Micrometres.
    Um,
    /// Nanometres.
    Nm,
}

impl Unit {
    /// Its length in mm.
    #[must_use]
    pub fn mm(self) -> f64 {
        match self {
            Self::Mm => 1.0,
            Self::Auto | Self::Um => 1e-3,
            Self::Nm => 1e-6,
        }
    }
}

/// Where a run begins: a file or a phantom.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Input {
    /// A volume (NIfTI, NRRD, MetaImage: `.nii`, `.nii.gz`, `.hdr`, `.nrrd`, `.nhdr`, `.mha`, `.mhd`; a folder of
    /// DICOM slices, or one of them) or a traced tree (`.swc`, `.vtp`, `.vtk`). Relative to the config's folder;
    /// `$ESPALIER_DATA` at its beginning is expanded.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub path: Option<String>,
    /// Instead of a file: the phantom to make; `[phantom]` has its shape.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub phantom: Option<espalier_phantom::Kind>,
    /// What the file is. Default `auto`: by its name.
    pub kind: InputKind,
    /// Which volume of a 4D file, from 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub volume_index: Option<usize>,
    /// Which DICOM series of a folder, from 1 as the message lists them. Default: the only one that can be a volume.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub series: Option<usize>,
    /// A file with the names of a label map's values, so that `volume.label` can be one of them: a label description of
    /// ITK-SNAP, a colour table of 3D Slicer (`.ctbl`, `.csv`), `dseg.tsv` of BIDS, JSON as of TotalSegmentator, or lines
    /// `1 left lung`. Relative to the config's folder. Default: none; the names are TotalSegmentator's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub labels: Option<String>,
    /// Resample DICOM slices of a tilted gantry, with gaps or at uneven distances to an even orthogonal grid. Default
    /// false: they are refused with the reason.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub resample: bool,
    /// The space of a volume or of polylines whose file does not name it; that of `tree.labels` too, if its file names
    /// none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub assume_space: Option<espalier_volume::AssumedSpace>,
    /// Refuse what would otherwise be repaired with a warning. Default false.
    pub strict: bool,
    /// The unit of the input's coordinates. Default `auto`: by the header of a volume; µm for a
    /// traced tree, mm if espalier wrote it or if it is of VTK.
    pub unit: Unit,
    /// How many units a step in x, y, z of a traced tree is. Default 1, 1, 1; for files in pixels and slices.
    pub scale: [f64; 3],
    /// How many units a step in a traced tree's radius is. Default 1.
    pub radius_scale: f64,
}

impl Default for Input {
    fn default() -> Self {
        Self {
            path: None,
            phantom: None,
            kind: InputKind::Auto,
            volume_index: None,
            series: None,
            labels: None,
            resample: false,
            assume_space: None,
            strict: false,
            unit: Unit::Auto,
            scale: [1.0; 3],
            radius_scale: 1.0,
        }
    }
}

/// The input, resolved.
#[derive(Clone, Debug, PartialEq)]
pub enum Source {
    /// A volume file.
    Volume(PathBuf),
    /// A traced tree file.
    Tree(PathBuf),
    /// A phantom with a scan.
    PhantomScan(espalier_phantom::Kind),
    /// A phantom that is traced at once.
    PhantomTree(espalier_phantom::Kind),
}

impl Input {
    /// Checks the keys against each other.
    ///
    /// # Errors
    /// [`ParamError`] with the key and what is legal.
    pub fn validate(&self) -> Result<(), ParamError> {
        let has_path = self.path.as_ref().is_some_and(|path| !path.is_empty());
        ParamError::check(
            "path",
            has_path || self.phantom.is_some(),
            "a run needs an input: set path to a file, or phantom = \"airway\" | \"vessel\" | \"neuron\"",
        )?;
        ParamError::check("path", !(has_path && self.phantom.is_some()), "set path or phantom, not both")?;
        ParamError::check("series", self.series != Some(0), "series count from 1, is 0")?;
        let is_scaled = self.scale != [1.0; 3] || self.radius_scale != 1.0;
        let is_used = !is_scaled || self.is_traced();
        ParamError::check(
            "scale",
            is_used,
            "scale and radius_scale are for traced trees; a volume states its own",
        )?;
        let is_scale = |scale: f64| scale.is_finite() && (1e-9..=1e9).contains(&scale);
        ParamError::check(
            "scale",
            self.scale.into_iter().all(is_scale),
            "must be three numbers in 1e-9..=1e9",
        )?;
        ParamError::check(
            "radius_scale",
            is_scale(self.radius_scale),
            format!("must be in 1e-9..=1e9, is {}", self.radius_scale),
        )
    }

    /// How many mm a step in the coordinates and radii of a traced tree is; espalier's own files are in mm unless
    /// `unit` says otherwise.
    #[must_use]
    pub fn traced_scale(&self, is_own_file: bool) -> SwcScale {
        let unit_mm = if self.unit == Unit::Auto && is_own_file { 1.0 } else { self.unit.mm() };
        SwcScale {
            position_mm: DVec3::from_array(self.scale) * unit_mm,
            radius_mm: self.radius_scale * unit_mm,
        }
    }

    /// The input's place, for a config in `base_dir` and data in `data_dir`.
    ///
    /// # Errors
    /// [`ParamError`] if the path begins with `$ESPALIER_DATA` and there is no `data_dir`.
    pub fn resolve(&self, base_dir: &Path, data_dir: Option<&Path>) -> Result<Source, ParamError> {
        if let Some(kind) = self.phantom {
            return Ok(if self.is_traced() { Source::PhantomTree(kind) } else { Source::PhantomScan(kind) });
        }
        let written = self.path.as_deref().unwrap_or_default();
        let in_data =
            written.strip_prefix(DATA_VARIABLE).filter(|rest| rest.is_empty() || rest.starts_with('/'));
        let path = match in_data {
            Some(rest) => {
                let data_dir = data_dir.ok_or_else(|| ParamError {
                    key: "path".into(),
                    message: format!("{written}: the variable ESPALIER_DATA is not set"),
                })?;
                data_dir.join(rest.trim_start_matches('/'))
            }
            None => base_dir.join(written),
        };
        Ok(if self.is_traced() { Source::Tree(path) } else { Source::Volume(path) })
    }

    /// Whether the run begins with a traced tree rather than a volume.
    #[must_use]
    pub fn is_traced(&self) -> bool {
        let written = Path::new(self.path.as_deref().unwrap_or_default());
        let is_tree = written.extension().is_some_and(|extension| {
            ["swc", "vtp", "vtk"].iter().any(|known| extension.eq_ignore_ascii_case(known))
        });
        match self.kind {
            InputKind::Tree => true,
            InputKind::Volume => false,
            InputKind::Auto => is_tree || self.phantom == Some(espalier_phantom::Kind::Neuron),
        }
    }
}
