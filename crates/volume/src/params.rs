//! What the caller may choose: how a volume becomes a mask.

use std::borrow::Cow;
use std::fmt;

use espalier_model::diagnose::ParamError;
use glam::DVec3;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{self, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::growth::Towards;
use crate::labels::Labels;
use crate::spacing::Spacing;

/// How a volume becomes a mask.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Params {
    /// What a scan shows, where nothing else is said: `"airway"` grows from the trachea, which it finds by itself, up
    /// to a threshold clear of that at which the region leaks into the lung, and at darker values over edges and corners
    /// too, for thin bronchi; `"vessel"` grows from a seed down to half-way
    /// between the values inside and those a few voxels outside, which it finds by itself, and never beyond a leak, or
    /// without a seed takes all from 150 HU on (vessels with contrast, and bone).
    /// Default: none, so that a scan is refused until a method is given. Keys that are set stay as they are; a mask
    /// or a label map needs no preset and heeds none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub preset: Option<Preset>,
    /// How the organ's voxels are chosen. Default `auto`: a volume of two values is the mask itself, a volume with
    /// `label` set is a label map, and everything else must be told.
    pub method: Method,
    /// The lower end of the band of values, inclusive, in scaled units (HU for CT). For `threshold` and
    /// `region-grow`. Default: none, no lower end. A larger value gives a smaller mask.
    pub lower: Option<f64>,
    /// The upper end of the band, inclusive. Default: none, no upper end. A larger value gives a larger mask; in
    /// an airway a little too much lets it leak into the lung.
    pub upper: Option<f64>,
    /// For `region-grow`: the voxel (x, y, z) from 0 on the file's own axes at which growing starts.
    /// Default: none; with `preset = "airway"` the trachea is looked for.
    pub seed_voxel: Option<[i64; 3]>,
    /// For `region-grow`: the point in RAS+ mm at which growing starts, instead of `seed_voxel`.
    pub seed_mm: Option<[f64; 3]>,
    /// For `label`: the organ in the label map, by value or by name, or several of them: `3`, `"trachea"`,
    /// `"lung_vessels, 2"`, `[1, 2]`. Names are those of TotalSegmentator's tasks `total` and `lung_vessels`, and
    /// `airway` for `lung_trachea_bronchia`.
    pub label: Option<Labels>,
    /// The spacing to work at, in mm: `"isotropic"` for the smallest of the volume's own along every axis, one number
    /// for all axes, or `[x, y, z]` on the file's own axes; each from 1e-6 to 1000. A scan is resampled by linear
    /// interpolation before voxels are chosen; of a mask or label map the chosen voxels are, cut at a half. Seeds in
    /// voxels are the file's. Default: none, the volume's own. Larger: fewer voxels, and thin branches are lost.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub resample_mm: Option<Spacing>,
    /// The radius in mm of the ball that closes gaps: background that no such ball can reach without touching the mask
    /// becomes foreground, before components are dropped. From 0 to 1000, and at most 64 voxels. Default 0: nothing is
    /// closed, for where vessels lie side by side a closing joins them. Larger: wider gaps close.
    pub closing_mm: f64,
    /// Which 26-connected components stay: `"largest"`, `"all"`, a number from 1 (so many, the largest first), or
    /// `"main"`, all with at least a twentieth of the largest one's voxels. Default `"auto"`: the largest of a scan,
    /// whose further components are bone and noise; the main ones of a mask or label map, which are what was
    /// segmented: the vessels of two lungs are two trees, and `tree.components` says what becomes of them.
    pub components: Components,
    /// The least volume of a component that stays, in ml, 0 to 1e6. Default 0: all that `components` keeps. With
    /// `components = "all"`, every component of at least this volume. Larger: fewer and larger components.
    pub min_component_ml: f64,
    /// The axis order of the mask, and of every volume that is made from it. Default `ras`: one organ gives one result
    /// in whatever order a file stores it.
    pub orientation: Orientation,
    /// Whether background that is closed in by the mask (6-connected) becomes foreground. Default true: a cavity
    /// would become a closed shell in the skeleton.
    pub fill_cavities: bool,
    /// Whether tunnels are closed at places where a blur of 0.7 voxel closes them: pinholes and bridges of a voxel or
    /// two, faults of the mask, each of which would be a loop of the skeleton. Default true: loops hide tips from a
    /// skeleton. Tunnels that are left are cut in the tree.
    pub close_tunnels: bool,
    /// From which thickness on slices are interpolated: an axis whose spacing is at least this multiple of the smallest
    /// gets slices in between, by the shape of the mask on both sides, 2 to 16 to an old one. 1.2 to 1000, or 0 for never;
    /// and never with `resample_mm` or with `orientation = "stored"`, which say what the grid is. Default 2.5: on phantoms
    /// slices of 2.5 mm then lose a tenth of the tips that they lost, and the centreline of a rough one comes nearer to the
    /// axis by 40 %; on slices twice as thick as wide rough ones lost a few more. The mask and all that follows are on the
    /// new grid. Larger: only thicker slices are interpolated.
    pub thick_slices: f64,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            preset: None,
            method: Method::Auto,
            lower: None,
            upper: None,
            seed_voxel: None,
            seed_mm: None,
            label: None,
            resample_mm: None,
            closing_mm: 0.0,
            components: Components::Auto,
            min_component_ml: 0.0,
            orientation: Orientation::Ras,
            fill_cavities: true,
            close_tunnels: true,
            thick_slices: 2.5,
        }
    }
}

/// In which axis order a mask is handed on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Orientation {
    /// x to the right, y to anterior, z to superior, as near as the scan's axes allow; the origin rounded to a 128th of
    /// a voxel, which single precision cannot blur.
    #[default]
    Ras,
    /// That of the file, and its origin: for comparisons voxel by voxel.
    Stored,
}

/// What a scan shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Preset {
    /// Airways: air inside walls.
    Airway,
    /// Vessels with contrast: bright inside dark.
    Vessel,
}

impl Preset {
    /// Towards which values a region grows from inside the organ.
    #[must_use]
    pub fn towards(self) -> Towards {
        match self {
            Self::Airway => Towards::Bright,
            Self::Vessel => Towards::Dark,
        }
    }

    /// How far a region grows at most, in HU. Airways: half-way from air to tissue, where a voxel is half wall.
    /// Vessels: well above tissue without contrast.
    #[must_use]
    pub fn limit_hu(self) -> f64 {
        match self {
            Self::Airway => -500.0,
            Self::Vessel => 100.0,
        }
    }
}

/// Where vessels with contrast begin, in HU: above tissue and most of its noise.
pub(crate) const VESSEL_FROM_HU: f64 = 150.0;

/// How the organ's voxels are chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// By what the volume is; never a silent guess.
    Auto,
    /// Every voxel that is not 0; of two values that are both not 0, the larger.
    Mask,
    /// Every voxel with a value in the band.
    Threshold,
    /// The voxels in the band that are 6-connected with the seed. With a preset and no band, the band's end is found, and
    /// airways win thin bronchi over edges and corners.
    RegionGrow,
    /// Every voxel with a value of `label`.
    Label,
}

impl Method {
    /// The name in the config.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::Mask => "mask",
            Self::Threshold => "threshold",
            Self::RegionGrow => "region-grow",
            Self::Label => "label",
        }
    }

    fn uses_band(self) -> bool {
        matches!(self, Self::Threshold | Self::RegionGrow)
    }

    fn uses_label(self) -> bool {
        matches!(self, Self::Auto | Self::Label)
    }
}

/// Which components of a mask stay. In a config `"auto"`, `"largest"`, `"main"`, `"all"` or a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Components {
    /// `Largest` where voxels were chosen by intensities, else `Main`.
    Auto,
    /// The one with the most voxels.
    Largest,
    /// Those with at least a twentieth of its voxels.
    Main,
    /// All of them.
    All,
    /// So many, those with the most voxels.
    Count(u32),
}

/// A component of at least this share of the largest one is no island of noise. Of eight masks of airways, vessels and a
/// neuron, the largest component but one has 0.7 % at most; of the vessels of two lungs the three largest stand as
/// 100 : 67 : 12, the next has 2.8 %.
pub(crate) const MAIN_SHARE: f64 = 0.05;

impl Components {
    /// What `Auto` means for voxels that were chosen by intensities, or that were not.
    pub(crate) fn settled(self, is_of_scan: bool) -> Self {
        match (self, is_of_scan) {
            (Self::Auto, true) => Self::Largest,
            (Self::Auto, false) => Self::Main,
            _ => self,
        }
    }

    /// The most components that stay.
    #[must_use]
    pub fn limit(self) -> usize {
        match self {
            Self::Largest => 1,
            Self::Auto | Self::Main | Self::All => usize::MAX,
            Self::Count(count) => count as usize,
        }
    }
}

impl Serialize for Components {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Auto => serializer.serialize_str("auto"),
            Self::Main => serializer.serialize_str("main"),
            Self::Largest => serializer.serialize_str("largest"),
            Self::All => serializer.serialize_str("all"),
            Self::Count(count) => serializer.serialize_u32(*count),
        }
    }
}

impl<'de> Deserialize<'de> for Components {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(ComponentsVisitor)
    }
}

struct ComponentsVisitor;

impl Visitor<'_> for ComponentsVisitor {
    type Value = Components;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("\"auto\", \"largest\", \"main\", \"all\" or a whole number from 1")
    }

    fn visit_str<E: de::Error>(self, text: &str) -> Result<Components, E> {
        match text {
            "auto" => Ok(Components::Auto),
            "main" => Ok(Components::Main),
            "largest" => Ok(Components::Largest),
            "all" => Ok(Components::All),
            _ => Err(E::invalid_value(de::Unexpected::Str(text), &self)),
        }
    }

    fn visit_i64<E: de::Error>(self, count: i64) -> Result<Components, E> {
        let legal = u32::try_from(count).ok().filter(|&count| count > 0);
        legal.map(Components::Count).ok_or_else(|| E::invalid_value(de::Unexpected::Signed(count), &self))
    }

    fn visit_u64<E: de::Error>(self, count: u64) -> Result<Components, E> {
        self.visit_i64(i64::try_from(count).unwrap_or(i64::MAX))
    }
}

impl Params {
    /// Whether the input is taken for a scan, whose values mean something, not for a mask or a label map.
    #[must_use]
    pub fn is_of_scan(&self) -> bool {
        self.preset.is_some() || matches!(self.method, Method::Threshold | Method::RegionGrow)
    }

    /// Checks each value, and that no key is set that the method would not look at.
    ///
    /// # Errors
    /// The first key that is out of its range, missing, or without use.
    pub fn validate(&self) -> Result<(), ParamError> {
        let method = self.method;
        let unused = |key, is_set: bool, needs: &str| {
            let message = format!("has no use with method = \"{}\", only with {needs}", method.name());
            ParamError::check(key, !is_set, message)
        };
        // A preset may turn `auto` into any of these.
        let is_free = method == Method::Auto && self.preset.is_some();
        if !method.uses_band() && !is_free {
            let needs = "\"threshold\" and \"region-grow\"";
            unused("lower", self.lower.is_some(), needs)?;
            unused("upper", self.upper.is_some(), needs)?;
        }
        if method != Method::RegionGrow && !is_free {
            unused("seed_voxel", self.seed_voxel.is_some(), "\"region-grow\"")?;
            unused("seed_mm", self.seed_mm.is_some(), "\"region-grow\"")?;
        }
        if !method.uses_label() {
            unused("label", self.label.is_some(), "\"label\"")?;
        }
        self.validate_band()?;
        self.validate_seed()?;
        let are_legal = self.label.as_ref().is_none_or(Labels::are_legal);
        ParamError::check("label", are_legal, "must be a finite number, a name, or several of them")?;
        let needs_label = method == Method::Label && self.label.is_none();
        ParamError::check("label", !needs_label, "must be set with method = \"label\"")?;
        let spacing = self.resample_mm.map_or(DVec3::ONE, |spacing| spacing.mm(DVec3::ONE));
        let is_spacing = spacing.to_array().iter().all(|mm| (1e-6..=1e3).contains(mm));
        ParamError::check("resample_mm", is_spacing, format!("must be from 1e-6 to 1000, is {spacing}"))?;
        let closing = self.closing_mm;
        let message = format!("must be from 0 to 1000, is {closing}");
        ParamError::check("closing_mm", (0.0..=1e3).contains(&closing), message)?;
        let keeps_one = self.components.limit() > 0;
        ParamError::check("components", keeps_one, "must be a word or a number from 1, is 0")?;
        let thick = self.thick_slices;
        let is_legal = thick == 0.0 || (1.2..=1e3).contains(&thick);
        ParamError::check("thick_slices", is_legal, format!("must be 0 or from 1.2 to 1000, is {thick}"))?;
        let least = self.min_component_ml;
        let message = format!("must be from 0 to 1e6, is {least}");
        ParamError::check("min_component_ml", (0.0..=1e6).contains(&least), message)
    }

    fn validate_band(&self) -> Result<(), ParamError> {
        ParamError::check("lower", self.lower.is_none_or(|v| !v.is_nan()), "must be a number, is nan")?;
        ParamError::check("upper", self.upper.is_none_or(|v| !v.is_nan()), "must be a number, is nan")?;
        let is_found = self.method == Method::RegionGrow && self.preset.is_some();
        let is_open = self.lower.is_none() && self.upper.is_none() && !is_found;
        let message = format!("or `lower` must be set with method = \"{}\"", self.method.name());
        ParamError::check("upper", !(self.method.uses_band() && is_open), message)?;
        let (lower, upper) = self.band();
        ParamError::check("upper", lower <= upper, format!("must be at least lower = {lower}, is {upper}"))
    }

    fn validate_seed(&self) -> Result<(), ParamError> {
        let is_finite = self.seed_mm.is_none_or(|seed| seed.iter().all(|v| v.is_finite()));
        ParamError::check("seed_mm", is_finite, "must be three finite numbers")?;
        let is_double = self.seed_mm.is_some() && self.seed_voxel.is_some();
        ParamError::check("seed_mm", !is_double, "must not be set together with seed_voxel")?;
        let is_missing =
            self.method == Method::RegionGrow && self.preset != Some(Preset::Airway) && !self.has_seed();
        ParamError::check("seed_voxel", !is_missing, "or seed_mm must be set with method = \"region-grow\"")
    }

    /// Whether a seed is given.
    #[must_use]
    pub fn has_seed(&self) -> bool {
        self.seed_mm.is_some() || self.seed_voxel.is_some()
    }

    /// The band of values, with infinite ends where none is set.
    #[must_use]
    pub fn band(&self) -> (f64, f64) {
        (self.lower.unwrap_or(f64::NEG_INFINITY), self.upper.unwrap_or(f64::INFINITY))
    }
}

/// What the reader below takes, for the schema of the config.
impl JsonSchema for Components {
    fn schema_name() -> Cow<'static, str> {
        "Components".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "anyOf": [
            { "type": "string", "const": "auto", "description": "`largest` of a scan, `main` of a mask or label map." },
            { "type": "string", "const": "largest", "description": "The one with the most voxels." },
            { "type": "string", "const": "main", "description": "Those with at least a twentieth of its voxels." },
            { "type": "string", "const": "all", "description": "All of them." },
            { "type": "integer", "minimum": 1 },
        ] })
    }
}
