//! Labels by value or by name.
//!
//! **Input** what the user wrote, and the values of a label map. **Output** the values that are meant.
//! **Steps** a number is itself; a name is looked up in the public class names of TotalSegmentator: those of its task
//! `total`, then those of its task `lung_vessels`.
//! **Guarantees** a name is taken only where the volume can come from that task, holding none but its values; and
//! what it was taken for is in the report. Never a silent guess.
//! **Source** the class names and numbers of TotalSegmentator version 2.
//! **Cost** constant.

use std::fmt;

use serde::de::{self, SeqAccess, Visitor};
use serde::ser::SerializeSeq;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::Error;

/// The classes of the task `total` of TotalSegmentator 2, from 1 on.
const TOTAL: [&str; 117] = [
    "spleen",
    "kidney_right",
    "kidney_left",
    "gallbladder",
    "liver",
    "stomach",
    "pancreas",
    "adrenal_gland_right",
    "adrenal_gland_left",
    "lung_upper_lobe_left",
    "lung_lower_lobe_left",
    "lung_upper_lobe_right",
    "lung_middle_lobe_right",
    "lung_lower_lobe_right",
    "esophagus",
    "trachea",
    "thyroid_gland",
    "small_bowel",
    "duodenum",
    "colon",
    "urinary_bladder",
    "prostate",
    "kidney_cyst_left",
    "kidney_cyst_right",
    "sacrum",
    "vertebrae_S1",
    "vertebrae_L5",
    "vertebrae_L4",
    "vertebrae_L3",
    "vertebrae_L2",
    "vertebrae_L1",
    "vertebrae_T12",
    "vertebrae_T11",
    "vertebrae_T10",
    "vertebrae_T9",
    "vertebrae_T8",
    "vertebrae_T7",
    "vertebrae_T6",
    "vertebrae_T5",
    "vertebrae_T4",
    "vertebrae_T3",
    "vertebrae_T2",
    "vertebrae_T1",
    "vertebrae_C7",
    "vertebrae_C6",
    "vertebrae_C5",
    "vertebrae_C4",
    "vertebrae_C3",
    "vertebrae_C2",
    "vertebrae_C1",
    "heart",
    "aorta",
    "pulmonary_vein",
    "brachiocephalic_trunk",
    "subclavian_artery_right",
    "subclavian_artery_left",
    "common_carotid_artery_right",
    "common_carotid_artery_left",
    "brachiocephalic_vein_left",
    "brachiocephalic_vein_right",
    "atrial_appendage_left",
    "superior_vena_cava",
    "inferior_vena_cava",
    "portal_vein_and_splenic_vein",
    "iliac_artery_left",
    "iliac_artery_right",
    "iliac_vena_left",
    "iliac_vena_right",
    "humerus_left",
    "humerus_right",
    "scapula_left",
    "scapula_right",
    "clavicula_left",
    "clavicula_right",
    "femur_left",
    "femur_right",
    "hip_left",
    "hip_right",
    "spinal_cord",
    "gluteus_maximus_left",
    "gluteus_maximus_right",
    "gluteus_medius_left",
    "gluteus_medius_right",
    "gluteus_minimus_left",
    "gluteus_minimus_right",
    "autochthon_left",
    "autochthon_right",
    "iliopsoas_left",
    "iliopsoas_right",
    "brain",
    "skull",
    "rib_left_1",
    "rib_left_2",
    "rib_left_3",
    "rib_left_4",
    "rib_left_5",
    "rib_left_6",
    "rib_left_7",
    "rib_left_8",
    "rib_left_9",
    "rib_left_10",
    "rib_left_11",
    "rib_left_12",
    "rib_right_1",
    "rib_right_2",
    "rib_right_3",
    "rib_right_4",
    "rib_right_5",
    "rib_right_6",
    "rib_right_7",
    "rib_right_8",
    "rib_right_9",
    "rib_right_10",
    "rib_right_11",
    "rib_right_12",
    "sternum",
    "costal_cartilages",
];

/// The classes of the task `lung_vessels`, from 1 on.
const LUNG_VESSELS: [&str; 2] = ["lung_vessels", "lung_trachea_bronchia"];

/// Other words for classes.
const SYNONYMS: [(&str, &str); 3] = [
    ("airway", "lung_trachea_bronchia"),
    ("airways", "lung_trachea_bronchia"),
    ("bronchi", "lung_trachea_bronchia"),
];

const TASKS: [(&str, &[&str]); 2] = [("total", &TOTAL), ("lung_vessels", &LUNG_VESSELS)];

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

/// The three names that are nearest.
fn nearest(name: &str) -> Vec<String> {
    let names = TASKS.iter().flat_map(|(_, classes)| classes.iter().copied());
    let synonyms = SYNONYMS.iter().map(|(word, _)| *word);
    let mut ranked: Vec<(usize, &str)> = names
        .chain(synonyms)
        .map(|other| (strsim::damerau_levenshtein(name, &other.to_lowercase()), other))
        .collect();
    // Names that hold the word, or are held by it, come first.
    ranked
        .sort_by_key(|&(distance, other)| (!(other.contains(name) || name.contains(other)), distance, other));
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

#[cfg(test)]
mod tests {
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
    fn labels_are_read_as_they_are_written() {
        let labels = Labels::parse("trachea, 51,lung_vessels");
        let names = |name: &str| Label::Name(name.to_owned());
        assert_eq!(labels.0, [names("trachea"), Label::Value(51.0), names("lung_vessels")]);
        assert_eq!((labels.to_string().as_str(), labels.values()), ("trachea, 51, lung_vessels", None));
        assert_eq!(Labels::parse("3,4").values(), Some(vec![3.0, 4.0]));
        assert!(!Labels::parse(" , ").are_legal() && !Labels::from(f64::NAN).are_legal());
    }
}
