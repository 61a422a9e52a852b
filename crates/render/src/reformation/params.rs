//! The parameters of the scan on the map.

use std::borrow::Cow;
use std::fmt;

use espalier_model::diagnose::ParamError;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{self, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Which values are told apart. In a config a name, or `[low, high]`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Window {
    /// By what fills the tree: air takes the lung window, contrast that of vessels; all else, and what is not in HU,
    /// percentiles.
    #[default]
    Auto,
    /// -1000 to 200 HU: air, lung, walls and vessels.
    Lung,
    /// -160 to 240 HU.
    SoftTissue,
    /// -100 to 700 HU: contrast, and calcium brighter than it.
    Vessel,
    /// The first to the 99th percentile of what is on the map.
    Percentiles,
    /// What is black and what is white.
    Range([f64; 2]),
}

/// The windows that have names.
const NAMED: [(&str, Window); 5] = [
    ("auto", Window::Auto),
    ("lung", Window::Lung),
    ("soft-tissue", Window::SoftTissue),
    ("vessel", Window::Vessel),
    ("percentiles", Window::Percentiles),
];

/// What a slab shows of the values across it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Slab {
    /// Their mean: less noise.
    #[default]
    Mean,
    /// The largest (maximum intensity projection): vessels with contrast, calcium.
    Mip,
    /// The smallest (minimum intensity projection): airways.
    Minip,
}

/// The parameters of the scan on the map.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct VolumeParams {
    /// The scan to be shown, a file in the same space as the tree, relative to the config's folder. Default: the run's
    /// own input. Needed where that is a mask, a label map or a traced tree, which have no values to show.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub image: Option<String>,
    /// Which values are black and white: `"lung"` (-1000 to 200 HU), `"vessel"` (-100 to 700), `"soft-tissue"` (-160 to
    /// 240), `"percentiles"` (1 and 99 of what is on the map), or `[low, high]` in the scan's own values. Default
    /// `"auto"`: by what fills the tree.
    pub window: Window,
    /// How far beyond the wall of a branch the scan is shown, in mm, 0 to 100. Default 2: the wall and what touches it.
    /// Larger shows more of what lies around, and more of it in two places.
    pub reach_mm: f64,
    /// The same in radii of the branch, added to it, 0 to 10. Default 1: broad branches show more around them.
    pub reach_radii: f64,
    /// The thickness over which values are gathered, half of it before and half behind the surface of the map, in mm,
    /// 0 to 100. Default 0: the surface alone. Larger shows what lies just off it, and blurs slanting walls.
    pub slab_mm: f64,
    /// What a slab shows of them: `"mean"`, `"mip"` (the largest) or `"minip"` (the smallest). Default the mean.
    pub slab: Slab,
}

impl Default for VolumeParams {
    fn default() -> Self {
        Self {
            image: None,
            window: Window::Auto,
            reach_mm: 2.0,
            reach_radii: 1.0,
            slab_mm: 0.0,
            slab: Slab::Mean,
        }
    }
}

impl VolumeParams {
    /// Checks every range.
    ///
    /// # Errors
    /// The first key outside its range.
    pub fn validate(&self) -> Result<(), ParamError> {
        for (key, value, largest) in [
            ("volume.reach_mm", self.reach_mm, 100.0),
            ("volume.reach_radii", self.reach_radii, 10.0),
            ("volume.slab_mm", self.slab_mm, 100.0),
        ] {
            let is_legal = (0.0..=largest).contains(&value);
            ParamError::check(key, is_legal, format!("must be 0 to {largest}, is {value}"))?;
        }
        let Window::Range([low, high]) = self.window else { return Ok(()) };
        ParamError::check(
            "volume.window",
            low.is_finite() && high.is_finite() && high - low >= 1e-6 && high - low <= 1e12,
            format!("must be [low, high], two numbers with the lower first, is [{low}, {high}]"),
        )
    }

    /// How far from the wall of a tube of this radius the scan is shown, mm.
    pub(crate) fn reach(&self, radius_mm: f64) -> f64 {
        self.reach_mm + self.reach_radii * radius_mm
    }

    /// How far from the centreline any of its values come from, mm.
    #[must_use]
    pub fn farthest_mm(&self, radius_mm: f64) -> f64 {
        radius_mm + self.reach(radius_mm) + 0.5 * self.slab_mm
    }
}

impl Serialize for Window {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match (self, NAMED.iter().find(|(_, window)| window == self)) {
            (Self::Range(range), _) => range.serialize(serializer),
            (_, named) => serializer.serialize_str(named.map_or("auto", |(name, _)| name)),
        }
    }
}

impl<'de> Deserialize<'de> for Window {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(WindowVisitor)
    }
}

struct WindowVisitor;

impl<'de> Visitor<'de> for WindowVisitor {
    type Value = Window;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("\"auto\", \"lung\", \"vessel\", \"soft-tissue\", \"percentiles\", or [low, high]")
    }

    fn visit_str<E: de::Error>(self, text: &str) -> Result<Window, E> {
        let known = NAMED.iter().find(|(name, _)| *name == text);
        known.map(|(_, window)| *window).ok_or_else(|| E::invalid_value(de::Unexpected::Str(text), &self))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Window, A::Error> {
        let mut range = [0.0; 2];
        for (i, value) in range.iter_mut().enumerate() {
            *value = list.next_element()?.ok_or_else(|| de::Error::invalid_length(i, &self))?;
        }
        match list.next_element::<f64>()? {
            Some(_) => Err(de::Error::invalid_length(3, &self)),
            None => Ok(Window::Range(range)),
        }
    }
}

/// What the reader below takes, for the schema of the config.
impl JsonSchema for Window {
    fn schema_name() -> Cow<'static, str> {
        "Window".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "anyOf": [
            { "type": "string", "enum": NAMED.map(|(name, _)| name) },
            { "type": "array", "items": { "type": "number" }, "minItems": 2, "maxItems": 2 },
        ] })
    }
}
