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
    match wish(params) {
        Wish::Kind => {
            let background = background(inspect_kind(volume), params.method)?;
            Ok(Selection { bits: choose(volume, is_in_mask(background)), what: MASK.to_owned() })
        }
        Wish::Values { is_wanted, what } => Ok(Selection { bits: choose(volume, is_wanted), what }),
        Wish::Region => {
            let (lower, upper) = params.band();
            let seed = region_grow::seed_voxel(volume.grid(), params)?;
            let bits = region_grow::grow(volume, seed, (lower, upper))?;
            Ok(Selection { bits, what: format!("the region in {lower} to {upper}") })
        }
    }
}

/// What decides whether a voxel is chosen.
pub(crate) enum Wish {
    /// The kind of the volume, and then the voxel's value.
    Kind,
    /// The voxel's value alone.
    Values { is_wanted: Box<dyn Fn(f64) -> bool + Sync>, what: String },
    /// Its place and the whole volume.
    Region,
}

pub(crate) fn wish(params: &Params) -> Wish {
    let (lower, upper) = params.band();
    match (params.method, params.label) {
        (Method::Auto, None) | (Method::Mask, _) => Wish::Kind,
        (Method::Threshold, _) => Wish::Values {
            is_wanted: Box::new(move |value| (lower..=upper).contains(&value)),
            what: format!("the band {lower} to {upper}"),
        },
        (Method::RegionGrow, _) => Wish::Region,
        // `Params::validate` refuses the method `label` without one.
        (Method::Auto | Method::Label, label) => {
            let label = label.unwrap_or(f64::NAN);
            Wish::Values { is_wanted: Box::new(move |value| value == label), what: format!("label {label}") }
        }
    }
}

/// What the mask of a volume of two values is called.
pub(crate) const MASK: &str = "the mask";

/// Whether a voxel is in the mask of a volume with this background.
pub(crate) fn is_in_mask(background: f64) -> impl Fn(f64) -> bool + Sync {
    move |value| value != background && !value.is_nan()
}

/// The background of a volume of this kind, if it may be taken for a mask.
pub(crate) fn background(kind: Kind, method: Method) -> Result<f64, Error> {
    match kind {
        Kind::Mask { background, .. } => Ok(background),
        _ if method == Method::Mask => Ok(0.0),
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
