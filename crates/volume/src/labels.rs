//! Labels by value or by name.
//!
//! **Input** what the user wrote, and the values of a label map. **Output** the values that are meant.
//! **Steps** a number is itself; a name is looked up in the public class names of TotalSegmentator: those of its task
//! `total`, then those of its task `lung_vessels`.
//! **Guarantees** a name is taken only where the volume can come from that task, holding none but its values; and
//! what it was taken for is in the report. Never a silent guess.
//! **Source** the class names and numbers of TotalSegmentator version 2.
//! **Cost** constant.

mod classes;

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{self, SeqAccess, Visitor};
use serde::ser::SerializeSeq;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::Error;
use classes::{LUNG_VESSELS, SYNONYMS, TASKS};

/// How many names or values a message lists.
const N_LISTED: usize = 12;

/// Labels of the organ: `3`, `"trachea"`, `"lung_vessels, 2"` or `[1, "trachea"]`.
#[derive(Clone, Debug, PartialEq)]
pub struct Labels(pub Vec<Label>);

/// One of them.
#[derive(Clone, Debug, PartialEq)]
pub enum Label {
    /// By its value.
    Value(f64),
    /// By its name.
    Name(String),
}

impl From<f64> for Labels {
    fn from(value: f64) -> Self {
        Self(vec![Label::Value(value)])
    }
}

impl Labels {
    /// Labels as they are written in one string, separated by commas.
    #[must_use]
    pub fn parse(text: &str) -> Self {
        let words = text.split(',').map(str::trim).filter(|word| !word.is_empty());
        let label = |word: &str| word.parse().map_or_else(|_| Label::Name(word.to_owned()), Label::Value);
        Self(words.map(label).collect())
    }

    /// Whether there is one, and every number is finite.
    #[must_use]
    pub fn are_legal(&self) -> bool {
        let is_legal = |label: &Label| match label {
            Label::Value(value) => value.is_finite(),
            Label::Name(name) => !name.is_empty(),
        };
        !self.0.is_empty() && self.0.iter().all(is_legal)
    }

    /// The labels with a value in place of each name, by names that the user gave; and a sentence for each name. A name
    /// is looked for as it is written, then without regard to capitals, and spaces, hyphens, underscores and commas all
    /// one; where several values have it, it stands for all of them. What commas part may be one name with commas in
    /// it: of labels in a row the most that are a name together are taken for it.
    ///
    /// # Errors
    /// [`Error::NotNamed`] for a name that is not among them, with those that are nearest.
    pub fn by_names(&self, names: &BTreeMap<i64, String>) -> Result<(Self, Vec<String>), Error> {
        let (mut labels, mut notes) = (Vec::new(), Vec::new());
        let mut left = &self.0[..];
        while let Some(label) = left.first() {
            let (n_joined, name, values) = joined(left, names);
            left = &left[n_joined..];
            if n_joined == 1 && matches!(label, Label::Value(_)) {
                labels.push(label.clone());
                continue;
            }
            if values.is_empty() {
                let mut known: Vec<&str> = names.values().map(String::as_str).collect();
                known.dedup();
                let nearest = listed(nearest_of(&name, known.into_iter()).into_iter());
                return Err(Error::NotNamed { name, n_names: names.len(), nearest });
            }
            notes.push(format!("label {name} taken for {}", listed(values.iter().map(i64::to_string))));
            labels.extend(values.into_iter().map(|value| Label::Value(value as f64)));
        }
        Ok((Self(labels), notes))
    }

    /// The values, if none is given by name.
    pub(crate) fn values(&self) -> Option<Vec<f64>> {
        self.0.iter().map(|label| if let Label::Value(value) = label { Some(*value) } else { None }).collect()
    }
}

impl fmt::Display for Labels {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (label_idx, label) in self.0.iter().enumerate() {
            f.write_str(if label_idx > 0 { ", " } else { "" })?;
            match label {
                Label::Value(value) => write!(f, "{value}")?,
                Label::Name(name) => f.write_str(name)?,
            }
        }
        Ok(())
    }
}

/// The values of labels in a volume that holds `present`, and a sentence for each name.
pub(crate) fn resolve(labels: &Labels, present: &[f64]) -> Result<(Vec<f64>, Vec<String>), Error> {
    let mut values = Vec::new();
    let mut notes = Vec::new();
    for label in &labels.0 {
        match label {
            Label::Value(value) => values.push(*value),
            Label::Name(name) => {
                let (value, task) = look_up(name, present)?;
                values.push(value);
                notes.push(format!(
                    "label {name} taken for {value}, its number in TotalSegmentator's task {task}"
                ));
            }
        }
    }
    Ok((values, notes))
}

/// The value of a name and the task whose it is.
fn look_up(name: &str, present: &[f64]) -> Result<(f64, &'static str), Error> {
    let lower = name.to_lowercase();
    let known = SYNONYMS.iter().find(|(word, _)| *word == lower).map_or(lower.as_str(), |(_, class)| class);
    let found = TASKS.iter().find_map(|(task, classes)| {
        let place = classes.iter().position(|class| class.to_lowercase() == known)?;
        Some(((place + 1) as f64, *task, classes.len()))
    });
    let holds = listed(present.iter().filter(|&&value| value != 0.0).map(|&value| named(value, present)));
    let Some((value, task, n_classes)) = found else {
        let nearest = listed(nearest(&lower).into_iter());
        return Err(Error::UnknownLabel { name: name.to_owned(), nearest, holds });
    };
    let is_of_task = present.iter().all(|&value| value <= n_classes as f64);
    if !is_of_task || !present.contains(&value) {
        return Err(Error::AbsentLabel { name: name.to_owned(), value, task, holds });
    }
    Ok((value, task))
}

/// A value with its name in the one task that the volume can come from.
fn named(value: f64, present: &[f64]) -> String {
    let fits = |classes: &[&str]| present.iter().all(|&other| other <= classes.len() as f64);
    let (_, classes) = if fits(&LUNG_VESSELS) { TASKS[1] } else { TASKS[0] };
    let name = classes.get((value as usize).wrapping_sub(1)).filter(|_| fits(classes));
    name.map_or_else(|| value.to_string(), |name| format!("{value} ({name})"))
}

/// How many of the first labels are a name together, that name, and its values; the first alone if none are.
fn joined(labels: &[Label], names: &BTreeMap<i64, String>) -> (usize, String, Vec<i64>) {
    let most = names.values().map(|name| name.matches(',').count() + 1).max().unwrap_or(1);
    let together = |n: usize| {
        let name = Labels(labels[..n].to_vec()).to_string();
        let values = values_of(&name, names);
        (n, name, values)
    };
    let several = (2..=most.min(labels.len())).rev().map(together).find(|(.., values)| !values.is_empty());
    several.unwrap_or_else(|| together(1))
}

/// The values that have a name.
fn values_of(name: &str, names: &BTreeMap<i64, String>) -> Vec<i64> {
    let of = |is_same: &dyn Fn(&str) -> bool| -> Vec<i64> {
        names.iter().filter(|(_, known)| is_same(known)).map(|(&value, _)| value).collect()
    };
    let exact = of(&|known| known == name);
    if exact.is_empty() { of(&|known| folded(known) == folded(name)) } else { exact }
}

/// A name with its words in lower case, parted by single spaces; commas part words, too.
fn folded(name: &str) -> String {
    let is_gap = |letter: char| letter.is_whitespace() || matches!(letter, '_' | '-' | ',');
    let words: Vec<&str> = name.split(is_gap).filter(|word| !word.is_empty()).collect();
    words.join(" ").to_lowercase()
}

/// The three names that are nearest.
fn nearest(name: &str) -> Vec<String> {
    let names = TASKS.iter().flat_map(|(_, classes)| classes.iter().copied());
    let synonyms = SYNONYMS.iter().map(|(word, _)| *word);
    nearest_of(name, names.chain(synonyms))
}

/// The three of some names that are nearest.
fn nearest_of<'a>(name: &str, names: impl Iterator<Item = &'a str>) -> Vec<String> {
    let name = &name.to_lowercase();
    let mut ranked: Vec<(usize, &str)> =
        names.map(|other| (strsim::damerau_levenshtein(name, &other.to_lowercase()), other)).collect();
    // Names that hold the word, or are held by it, come first.
    ranked.sort_by_key(|&(distance, other)| {
        (!(other.contains(name.as_str()) || name.contains(other)), distance, other)
    });
    ranked.iter().take(3).map(|(_, other)| (*other).to_owned()).collect()
}

fn listed(words: impl Iterator<Item = String>) -> String {
    let words: Vec<String> = words.collect();
    let more = if words.len() > N_LISTED { format!(" … ({} in all)", words.len()) } else { String::new() };
    format!("{}{more}", words[..words.len().min(N_LISTED)].join(", "))
}

impl Serialize for Label {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Value(value) if value.trunc() == *value && value.abs() < 1e15 => {
                serializer.serialize_i64(*value as i64)
            }
            Self::Value(value) => serializer.serialize_f64(*value),
            Self::Name(name) => serializer.serialize_str(name),
        }
    }
}

impl Serialize for Labels {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        if let [label] = &self.0[..] {
            return label.serialize(serializer);
        }
        let mut list = serializer.serialize_seq(Some(self.0.len()))?;
        self.0.iter().try_for_each(|label| list.serialize_element(label))?;
        list.end()
    }
}

impl<'de> Deserialize<'de> for Labels {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(LabelsVisitor)
    }
}

struct LabelsVisitor;

impl<'de> Visitor<'de> for LabelsVisitor {
    type Value = Labels;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a number, a name, names and numbers separated by commas, or a list of them")
    }

    fn visit_str<E: de::Error>(self, text: &str) -> Result<Labels, E> {
        Ok(Labels::parse(text))
    }

    fn visit_f64<E: de::Error>(self, value: f64) -> Result<Labels, E> {
        Ok(value.into())
    }

    fn visit_i64<E: de::Error>(self, value: i64) -> Result<Labels, E> {
        Ok((value as f64).into())
    }

    fn visit_u64<E: de::Error>(self, value: u64) -> Result<Labels, E> {
        Ok((value as f64).into())
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Labels, A::Error> {
        let mut labels = Vec::new();
        while let Some(Labels(more)) = list.next_element()? {
            labels.extend(more);
        }
        Ok(Labels(labels))
    }
}

/// What the reader below takes, for the schema of the config.
impl JsonSchema for Labels {
    fn schema_name() -> Cow<'static, str> {
        "Labels".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "anyOf": [
            { "type": "string" },
            { "type": "number" },
            { "type": "array", "items": { "anyOf": [{ "type": "string" }, { "type": "number" }] } },
        ] })
    }
}

#[cfg(test)]
mod tests {
    use super::classes::TOTAL;
    use super::*;

    fn value_of(name: &str, present: &[f64]) -> Result<f64, String> {
        look_up(name, present).map(|(value, _)| value).map_err(|error| error.to_string())
    }

    #[test]
    fn names_are_taken_where_the_volume_can_hold_them() {
        assert_eq!(
            (TOTAL[15], TOTAL[50], TOTAL[51], TOTAL[116]),
            ("trachea", "heart", "aorta", "costal_cartilages")
        );
        assert_eq!(value_of("trachea", &[0.0, 16.0, 51.0]), Ok(16.0));
        assert_eq!(value_of("Vertebrae_L1", &[0.0, 31.0]), Ok(31.0));
        assert_eq!(value_of("lung_vessels", &[0.0, 1.0, 2.0]), Ok(1.0));
        assert_eq!(value_of("airway", &[0.0, 1.0, 2.0]), Ok(2.0));
        // In a map of the task `total`, 1 is the spleen.
        let error = value_of("lung_vessels", &[0.0, 1.0, 2.0, 51.0]).expect_err("another task");
        assert!(error.contains("51 (heart)"), "{error}");
        let error = value_of("trachea", &[0.0, 1.0, 2.0]).expect_err("another task");
        assert!(error.contains("2 (lung_trachea_bronchia)"), "{error}");
    }

    #[test]
    fn unknown_names_are_told_the_nearest() {
        let error = value_of("trachae", &[0.0, 16.0]).expect_err("unknown");
        assert!(error.contains("16 (trachea)"), "{error}");
        assert_eq!(nearest("trachae")[0], "trachea");
        assert_eq!(nearest("iliac_vena")[..2], ["iliac_vena_left", "iliac_vena_right"]);
    }

    #[test]
    fn names_of_the_users_own() {
        let names = ["left lung", "right_lung", "Left Lung", "Aorta"];
        let names: BTreeMap<i64, String> = (10..).zip(names.map(str::to_owned)).collect();
        let values = |text: &str| Labels::parse(text).by_names(&names).map(|(labels, _)| labels.values());
        assert_eq!(values("left lung").expect("exact"), Some(vec![10.0]));
        assert_eq!(values("LEFT-LUNG").expect("folded"), Some(vec![10.0, 12.0]));
        assert_eq!(values("right lung, 7, aorta").expect("three"), Some(vec![11.0, 7.0, 13.0]));
        let error = values("rigth lung").expect_err("unknown").to_string();
        assert!(
            error.contains("none of the 4 names is rigth lung") && error.contains("right_lung"),
            "{error}"
        );
        // Of a file of the user's own, no other names count.
        assert!(values("trachea").is_err());
    }

    #[test]
    fn names_may_have_commas() {
        let names = ["lung, left", "lung", "lobe 3, 5, upper", "left"];
        let names: BTreeMap<i64, String> = (1..).zip(names.map(str::to_owned)).collect();
        let values = |text: &str| Labels::parse(text).by_names(&names).map(|(labels, _)| labels.values());
        assert_eq!(values("lung, left").expect("one name"), Some(vec![1.0]));
        assert_eq!(values("LUNG,left, lung").expect("two"), Some(vec![1.0, 2.0]));
        assert_eq!(values("left, lung").expect("two"), Some(vec![4.0, 2.0]));
        assert_eq!(values("7, lobe 3, 5, upper, 5").expect("a value within"), Some(vec![7.0, 3.0, 5.0]));
        assert!(values("lung, right").is_err());
    }

    #[test]
    fn labels_are_read_as_they_are_written() {
        let labels = Labels::parse("trachea, 51,lung_vessels");
        let names = |name: &str| Label::Name(name.to_owned());
        assert_eq!(labels.0, [names("trachea"), Label::Value(51.0), names("lung_vessels")]);
        assert_eq!((labels.to_string().as_str(), labels.values()), ("trachea, 51, lung_vessels", None));
        assert_eq!(Labels::parse("3,4").values(), Some(vec![3.0, 4.0]));
        assert!(!Labels::parse(" , ").are_legal() && !Labels::from(f64::NAN).are_legal());
    }
}
