//! The parameters of the pictures.

use espalier_model::diagnose::ParamError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::reformation::params::VolumeParams;

/// How the branches are drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Style {
    /// Lit round cones between the radii of the nodes (section 4.1 of [Hu2022]).
    #[default]
    PseudoSurface,
    /// Flat bands of the true width, for print in few colours and for labels over them.
    Ribbon,
    /// The bare skeleton as lines of one width.
    Line,
    /// The scan along the branches in greys, with their outline: a curved planar reformation of the whole tree. The
    /// global view and the comparison of methods stay pseudo-surfaces.
    Volume,
}

impl Style {
    /// Whether it is a picture of pixels, which no paths can draw.
    pub(crate) fn is_pixels(self) -> bool {
        matches!(self, Self::PseudoSurface | Self::Volume)
    }
}

/// The background and the ink.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Theme {
    /// Dark ink on white, for screens and paper.
    #[default]
    Light,
    /// Light ink on near-black, for a reading room and slides.
    Dark,
    /// Black ink and stronger outlines, for journals and grey printers.
    Print,
}

/// What the colours mean.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum ColorBy {
    /// The radius at each place against the mean radius of the tree.
    #[default]
    Radius,
    /// The mean radius of each branch against the mean radius of the tree, one colour a branch, as the paper does.
    BranchRadius,
    /// The number of forks between the root and the branch.
    Generation,
    /// One colour a branch, unlike its parent's and its neighbours', to find a branch in both pictures.
    Branch,
    /// By how many degrees the angle at the edge's upper node differs from its target.
    AngleLoss,
    /// By what share the length of the edge differs from its target.
    LengthLoss,
    /// By how many degrees the edge runs otherwise in space than the map's letters say.
    OrientationLoss,
    /// The main subtrees, each in a colour of its own, as in the comparison of methods.
    Part,
    /// The label of each branch, such as its lobe, in the colours of the table of names; of a traced tree without a
    /// label map the structure of each node (soma, axon, dendrite, …). Grey is what has none.
    Label,
}

/// Where the organ in space is seen from, in the figure of it beside the map.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum SpaceView {
    /// The global view, from which least of the tree is hidden or shortened.
    #[default]
    Global,
    /// From the front: the patient's right is on the left.
    Coronal,
    /// From the left: the front is on the left.
    Sagittal,
    /// From the feet, as slices are hung: the patient's right is on the left.
    Axial,
}

/// How the tree lies on its page.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Fit {
    /// As the embedding has it: as seen in the patient, or with the root on top.
    #[default]
    Upright,
    /// Turned as a whole, in whole degrees, so that it fills the page best. Letters turn along.
    Turned,
}

/// The unit of the scale bar and of the radii.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Unit {
    /// The unit in which the number is easiest to read.
    #[default]
    Auto,
    /// Metres.
    M,
    /// Centimetres.
    Cm,
    /// Millimetres.
    Mm,
    /// Micrometres.
    Um,
    /// Nanometres.
    Nm,
}

/// The letters at the edges of the map and of the global view, and at branches that run otherwise.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Compass {
    /// Anatomical, unless the caller knows that the tree was not made from a scan: then axes.
    #[default]
    Auto,
    /// R L A P S I: right, left, anterior, posterior, superior, inferior of the patient.
    Anatomical,
    /// +x −x +y −y +z −z, for data without a body, such as a neuron in a slice.
    Axes,
    /// No letters.
    None,
}

/// Labels of branches, such as lobes, to colour them by.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Labels {
    /// The labels, in the order of the legend.
    pub entries: Vec<LabelEntry>,
    /// By branch: the index of its label.
    pub of_branch: Vec<Option<usize>>,
}

/// A label.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LabelEntry {
    /// What it is called.
    pub name: String,
    /// Its colour, sRGB; without one it takes one of those for names.
    pub color: Option<[u8; 3]>,
}

/// The parameters of the pictures.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Params {
    /// Width of the pictures in pixels, 240 to 16384; the height follows from the shape of the tree. Default
    /// 1600: fills a screen, and prints 13.5 cm wide at 300 dpi. Larger shows finer branches and takes longer; under
    /// 480 only the tree, the verdict and the scale bar find room.
    pub width_px: u32,
    /// How the branches are drawn. Default the pseudo-surface; `"volume"` shows the scan along them; where the radii, as in a wrong unit, would cover the
    /// picture many times over, it gives way to lines, and heading and report say so.
    pub style: Style,
    /// Background and ink. Default light, for paper.
    pub theme: Theme,
    /// What the colours mean. Default the radius, as in the paper.
    pub color_by: ColorBy,
    /// The heading; none by default. Longer ones are broken into lines.
    pub title: Option<String>,
    /// Factor on every drawn radius, over 0 to 100. Default 1: true calibres. Larger makes thin trees easier to
    /// see, and lets neighbours overlap sooner. Colours and the EXR's `radius` keep the true values. A scan on the map
    /// has its true size whatever this says.
    pub width_scale: f64,
    /// The least width of a branch in pixels, 0.5 to 100; the width of every branch in the line style. Default 2:
    /// visible on screen and in print. Larger makes thin branches easier to see and hides their differences.
    pub min_width_px: f64,
    /// Unit of the scale bar and of the radii. Default automatic.
    pub unit: Unit,
    /// Letters at the edges of map and global view. Default auto: anatomical for a scan, axes for a traced tree. On a
    /// map they say where most of the tree's length runs; long branches that run otherwise have their own.
    pub compass: Compass,
    /// How the map lies on its page. Default upright.
    pub fit: Fit,
    /// Height of the map's page over its width, 0.2 to 5, such as 0.5625 for a slide or 1.414 for a sheet of paper.
    /// None by default: the page takes the tree's shape within 0.4 to 1.4.
    pub aspect: Option<f64>,
    /// Whether to make the figure of the organ in space beside the map. Default true.
    pub space: bool,
    /// Where that figure sees the organ from. Default the global view; one of the three planes of the body for
    /// comparison with slices.
    pub space_view: SpaceView,
    /// Whether to make the PDF, 300 pixels to an inch. Default true.
    pub pdf: bool,
    /// Whether to make the EXR with its layers. Default true; it is the largest of the files.
    pub exr: bool,
    /// `[render.volume]`: the scan on the map, for `style = "volume"`.
    pub volume: VolumeParams,
    /// The labels of the branches, of which the caller knows: no setting.
    #[serde(skip)]
    pub labels: Option<Labels>,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            width_px: 1600,
            style: Style::PseudoSurface,
            theme: Theme::Light,
            color_by: ColorBy::Radius,
            title: None,
            width_scale: 1.0,
            min_width_px: 2.0,
            unit: Unit::Auto,
            compass: Compass::Auto,
            fit: Fit::Upright,
            aspect: None,
            space: true,
            space_view: SpaceView::Global,
            pdf: true,
            exr: true,
            volume: VolumeParams::default(),
            labels: None,
        }
    }
}

impl Params {
    /// The paper's pictures (section 4.1 of [Hu2022]): one colour a branch, by its mean radius.
    #[must_use]
    pub fn paper() -> Self {
        Self { color_by: ColorBy::BranchRadius, ..Self::default() }
    }

    /// The factor on radii of the map: a scan has its true size.
    pub(crate) fn drawn_width_scale(&self) -> f64 {
        if self.style == Style::Volume { 1.0 } else { self.width_scale }
    }

    /// The same for pictures that have no scan to show: the pseudo-surface in its place.
    pub(crate) fn without_scan(&self) -> Self {
        let style = if self.style == Style::Volume { Style::PseudoSurface } else { self.style };
        Self { style, ..self.clone() }
    }

    /// Checks every range.
    ///
    /// # Errors
    /// The first key outside its range.
    pub fn validate(&self) -> Result<(), ParamError> {
        let Self { width_px, width_scale, min_width_px, .. } = *self;
        ParamError::check(
            "width_px",
            (240..=16_384).contains(&width_px),
            format!("must be 240 to 16384 pixels, is {width_px}"),
        )?;
        ParamError::check(
            "width_scale",
            width_scale > 0.0 && width_scale <= 100.0,
            format!("must be over 0 and at most 100, is {width_scale}"),
        )?;
        ParamError::check(
            "min_width_px",
            (0.5..=100.0).contains(&min_width_px),
            format!("must be 0.5 to 100 pixels, is {min_width_px}"),
        )?;
        ParamError::check(
            "aspect",
            self.aspect.is_none_or(|aspect| (0.2..=5.0).contains(&aspect)),
            format!("must be 0.2 to 5, is {}", self.aspect.unwrap_or_default()),
        )?;
        self.volume.validate()?;
        let title_chars = self.title.as_ref().map_or(0, |title| title.chars().count());
        ParamError::check(
            "title",
            title_chars <= 500,
            format!("must be at most 500 characters, is {title_chars}"),
        )
    }
}
