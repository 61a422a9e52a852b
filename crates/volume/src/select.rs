//! The voxels of the organ, by the value of each voxel alone.
//!
//! **Input** a volume and [`Params`]. **Output** one bit a voxel, and a phrase for what was chosen.
//! **Steps** 1. where the method is `auto`, settle it by what the volume is; 2. test each voxel.
//! **Guarantees** `auto` never guesses: it takes a volume of two values for the mask, a given label for a label,
//! and asks otherwise. A value that is not a number is never chosen.

use espalier_model::{Bits, Volume};

use crate::choose::choose;
use crate::{Error, Kind, Method, Params, inspect_kind, region_grow};

/// How many labels an error lists.
const N_LISTED: usize = 20;

/// The chosen voxels, and what they are called in messages.
pub(crate) struct Selection {
    pub(crate) bits: Bits,
    pub(crate) what: String,
}

pub(crate) fn select(volume: &Volume, params: &Params) -> Result<Selection, Error> {
    let (lower, upper) = params.band();
    match params.method {
        Method::Auto => select_by_kind(volume, params.label),
        Method::Mask => match inspect_kind(volume) {
            Kind::Mask { background, .. } => Ok(select_mask(volume, background)),
            _ => Ok(select_mask(volume, 0.0)),
        },
        Method::Threshold => Ok(Selection {
            bits: choose(volume, |value| (lower..=upper).contains(&value)),
            what: format!("the band {lower} to {upper}"),
        }),
        Method::RegionGrow => {
            let seed = region_grow::seed_voxel(volume.grid(), params)?;
            let bits = region_grow::grow(volume, seed, (lower, upper))?;
            Ok(Selection { bits, what: format!("the region in {lower} to {upper}") })
        }
        // `Params::validate` refuses this method without a label.
        Method::Label => Ok(select_label(volume, params.label.unwrap_or(f64::NAN))),
    }
}

fn select_label(volume: &Volume, label: f64) -> Selection {
    Selection { bits: choose(volume, |value| value == label), what: format!("label {label}") }
}

fn select_mask(volume: &Volume, background: f64) -> Selection {
    let bits = choose(volume, |value| value != background && !value.is_nan());
    Selection { bits, what: "the mask".to_owned() }
}

fn select_by_kind(volume: &Volume, label: Option<f64>) -> Result<Selection, Error> {
    if let Some(label) = label {
        return Ok(select_label(volume, label));
    }
    match inspect_kind(volume) {
        Kind::Mask { background, .. } => Ok(select_mask(volume, background)),
        Kind::Constant { value } => {
            Err(Error::Empty { what: "a volume of one value".to_owned(), min: value, max: value })
        }
        Kind::Labels { values } => Err(labels_need_one(&values)),
        Kind::Ct { min, max } => Err(Error::MethodNeeded {
            found: format!("the volume holds values from {min} to {max}, like a CT"),
            way_out:
                "set volume.method = \"region-grow\" with seed_voxel and upper (an airway: near -900 HU) \
                      or \"threshold\" with lower and upper (vessels with contrast: from 150 HU)"
                    .to_owned(),
        }),
    }
}

fn labels_need_one(values: &[f64]) -> Error {
    let labels: Vec<String> = values.iter().filter(|&&v| v != 0.0).map(f64::to_string).collect();
    let listed = labels[..labels.len().min(N_LISTED)].join(", ");
    let more =
        if labels.len() > N_LISTED { format!(" … ({} in all)", labels.len()) } else { String::new() };
    Error::MethodNeeded {
        found: format!("the volume holds {} whole values, like a label map", values.len()),
        way_out: format!(
            "set volume.label to one of {listed}{more}, as in --set volume.label={}; for a scan set volume.method to \
             \"region-grow\" or \"threshold\"",
            labels.first().map_or("1", String::as_str)
        ),
    }
}
