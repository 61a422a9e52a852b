//! The spacing that a volume is wanted at, as it stands in a config.

use std::borrow::Cow;
use std::fmt;

use glam::DVec3;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{self, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// The distance between voxels that is wanted. In a config `"isotropic"`, a number or three numbers, in mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Spacing {
    /// The smallest of the volume's own along every axis.
    Isotropic,
    /// The same along every axis, in mm.
    Cubic(f64),
    /// Along each of the file's axes, in mm.
    Each([f64; 3]),
}

impl Spacing {
    /// Along each axis, in mm, for a volume whose own is `own_mm`.
    #[must_use]
    pub fn mm(self, own_mm: DVec3) -> DVec3 {
        match self {
            Self::Isotropic => DVec3::splat(own_mm.min_element()),
            Self::Cubic(mm) => DVec3::splat(mm),
            Self::Each(mm) => DVec3::from_array(mm),
        }
    }
}

impl Spacing {
    /// The same once each axis has gone to the place that `places` has for it.
    pub(crate) fn turned(self, places: [usize; 3]) -> Self {
        let Self::Each(mm) = self else { return self };
        let mut turned = mm;
        places.into_iter().zip(mm).for_each(|(place, mm)| turned[place] = mm);
        Self::Each(turned)
    }
}

impl Serialize for Spacing {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Isotropic => serializer.serialize_str("isotropic"),
            Self::Cubic(mm) => serializer.serialize_f64(*mm),
            Self::Each(mm) => mm.serialize(serializer),
        }
    }
}

impl<'de> Deserialize<'de> for Spacing {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(SpacingVisitor)
    }
}

struct SpacingVisitor;

impl<'de> Visitor<'de> for SpacingVisitor {
    type Value = Spacing;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("\"isotropic\", a number of mm, or three of them")
    }

    fn visit_str<E: de::Error>(self, text: &str) -> Result<Spacing, E> {
        match text {
            "isotropic" => Ok(Spacing::Isotropic),
            _ => Err(E::invalid_value(de::Unexpected::Str(text), &self)),
        }
    }

    fn visit_f64<E: de::Error>(self, mm: f64) -> Result<Spacing, E> {
        Ok(Spacing::Cubic(mm))
    }

    fn visit_i64<E: de::Error>(self, mm: i64) -> Result<Spacing, E> {
        Ok(Spacing::Cubic(mm as f64))
    }

    fn visit_u64<E: de::Error>(self, mm: u64) -> Result<Spacing, E> {
        Ok(Spacing::Cubic(mm as f64))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Spacing, A::Error> {
        let mut each = [0.0; 3];
        for (axis, mm) in each.iter_mut().enumerate() {
            *mm = list.next_element()?.ok_or_else(|| de::Error::invalid_length(axis, &self))?;
        }
        match list.next_element::<f64>()? {
            Some(_) => Err(de::Error::invalid_length(4, &self)),
            None => Ok(Spacing::Each(each)),
        }
    }
}

/// What the reader below takes, for the schema of the config.
impl JsonSchema for Spacing {
    fn schema_name() -> Cow<'static, str> {
        "Spacing".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "anyOf": [
            { "type": "string", "const": "isotropic", "description": "The smallest of the volume's own along every axis." },
            { "type": "number" },
            { "type": "array", "items": { "type": "number" }, "minItems": 3, "maxItems": 3 },
        ] })
    }
}
