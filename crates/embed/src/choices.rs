//! The choices among the parameters: targets, methods, views, freedoms, starts, pulls, poses, what is done about widths
//! and behind the root, and the price of a crossing.
//!
//! Written in the config as words in kebab-case; the price of a crossing is the word `auto` or a number.

use std::borrow::Cow;
use std::fmt;

use espalier_model::{TargetKind, WidthMode};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{self, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Where target angles come from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum TargetMode {
    /// The exact angle in three dimensions; the local plane only tells the side.
    #[default]
    Intrinsic,
    /// The paper's: the angle as the local plane shows it.
    Projected,
}

impl From<TargetMode> for TargetKind {
    fn from(mode: TargetMode) -> Self {
        match mode {
            TargetMode::Intrinsic => Self::Intrinsic,
            TargetMode::Projected => Self::Projected,
        }
    }
}

/// Whether the space behind the root is kept free while sides are searched.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum KeepOut {
    /// Where the tree has a trunk: one branch leaves the root, and it is thicker than any other.
    #[default]
    Auto,
    /// Where one branch leaves the root.
    On,
    /// Nowhere.
    Off,
}

/// What is done about tubes that overlap.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum WidthsMode {
    /// They are counted.
    #[default]
    Report,
    /// Lengths and angles give way until nothing overlaps, as far as they can.
    Avoid,
    /// As `Avoid`; then all lengths are scaled against the radii, as little as it takes until nothing overlaps.
    Stretch,
}

impl WidthsMode {
    /// The name used in the config and in files.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Report => "report",
            Self::Avoid => "avoid",
            Self::Stretch => "stretch",
        }
    }
}

impl From<WidthsMode> for WidthMode {
    fn from(mode: WidthsMode) -> Self {
        match mode {
            WidthsMode::Report => Self::Report,
            WidthsMode::Avoid => Self::Avoid,
            WidthsMode::Stretch => Self::Stretch,
        }
    }
}

/// How the whole is turned in the end.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum PoseMode {
    /// As in the view, unless the caller knows that the tree was not made from a scan: then the root on top.
    #[default]
    Auto,
    /// As the global view shows the tree, as nearly as a rotation can.
    View,
    /// The root on top, as if the tree hung from it.
    RootOnTop,
}

/// A way to lay a tree flat.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// The best global view as it is, crossings and all.
    Projection,
    /// Wedges of equal angle per tip around the root.
    Radial,
    /// Nested cones that keep the side of every turn.
    Cone,
    /// The radial layout bent back towards one view: [Marino2015], reconstructed.
    Marino,
    /// The paper's particle swarm.
    Pso,
    /// Ours: mirror search, untangling, a barrier method and coordinate descent.
    #[default]
    Solver,
}

impl Method {
    /// The name used in the config and in tables.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Projection => "projection",
            Self::Radial => "radial",
            Self::Cone => "cone",
            Self::Marino => "marino",
            Self::Pso => "pso",
            Self::Solver => "solver",
        }
    }

    /// Whether the method searches for the least energy.
    #[must_use]
    pub fn is_optimiser(self) -> bool {
        matches!(self, Self::Pso | Self::Solver)
    }
}

/// The view towards which `marino` bends the radial layout. The anatomical ones are for RAS+, as radiologists see them:
/// the patient's right, or front, is on the viewer's left.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum MarinoView {
    /// The best global view.
    #[default]
    Auto,
    /// From the front.
    Coronal,
    /// From the left.
    Sagittal,
    /// From the feet.
    Axial,
    /// From `towards_camera`, with `up` upwards.
    Towards,
    /// The same, as `view_file` has them.
    File,
}

impl MarinoView {
    /// The name used in the config and in tables.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::Coronal => "coronal",
            Self::Sagittal => "sagittal",
            Self::Axial => "axial",
            Self::Towards => "towards",
            Self::File => "file",
        }
    }
}

/// What a swarm does after the solver.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum SwarmUse {
    /// Nothing.
    #[default]
    None,
    /// It searches around the solver's layout, with every layout of the run among its particles.
    Polish,
}

/// Which ratios a particle may choose on its own.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Freedom {
    /// As printed: one length and one angle ratio per segment.
    S,
    /// As `s`, with an own angle ratio for the first node of each segment.
    B,
    /// One length ratio per segment, one angle ratio per node.
    #[default]
    N,
}

impl Freedom {
    /// The name used in the config and in tables.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::S => "s",
            Self::B => "b",
            Self::N => "n",
        }
    }
}

/// Where the particles of a swarm start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Start {
    /// Uniform over the ranges, with P_0 = 0 and P_1 = the radial layout.
    Paper,
    /// Near the cone, brought towards the targets segment by segment as far as that is free of crossings.
    #[default]
    Relaxed,
}

/// How a particle is drawn to the best places.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Pull {
    /// Equation 5 as printed: on all ratios alike.
    Uniform,
    /// In a random subtree, or everywhere but there: what one subtree has found can be taken over alone.
    #[default]
    Subtree,
}

/// The price of a crossing.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum CrossingWeight {
    /// 1.5 times the largest energy of any layout without crossings.
    #[default]
    Auto,
    /// This much.
    Fixed(f64),
}

impl Serialize for CrossingWeight {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Auto => serializer.serialize_str("auto"),
            Self::Fixed(weight) => serializer.serialize_f64(*weight),
        }
    }
}

impl<'de> Deserialize<'de> for CrossingWeight {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct AutoOrNumber;
        impl Visitor<'_> for AutoOrNumber {
            type Value = CrossingWeight;

            fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
                formatter.write_str("\"auto\" or a number")
            }

            fn visit_str<E: de::Error>(self, text: &str) -> Result<CrossingWeight, E> {
                if text == "auto" {
                    Ok(CrossingWeight::Auto)
                } else {
                    Err(E::invalid_value(de::Unexpected::Str(text), &self))
                }
            }

            fn visit_f64<E: de::Error>(self, weight: f64) -> Result<CrossingWeight, E> {
                Ok(CrossingWeight::Fixed(weight))
            }

            fn visit_i64<E: de::Error>(self, weight: i64) -> Result<CrossingWeight, E> {
                Ok(CrossingWeight::Fixed(weight as f64))
            }

            fn visit_u64<E: de::Error>(self, weight: u64) -> Result<CrossingWeight, E> {
                Ok(CrossingWeight::Fixed(weight as f64))
            }
        }
        deserializer.deserialize_any(AutoOrNumber)
    }
}

/// What the reader below takes, for the schema of the config.
impl JsonSchema for CrossingWeight {
    fn schema_name() -> Cow<'static, str> {
        "CrossingWeight".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "anyOf": [
            { "type": "string", "const": "auto", "description": "1.5 times the largest energy of any layout without crossings." },
            { "type": "number", "exclusiveMinimum": 0 },
        ] })
    }
}
