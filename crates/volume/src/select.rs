//! The voxels of the organ, by the value of each voxel alone.
//!
//! **Input** a volume and [`Params`]. **Output** one bit a voxel, and a phrase for what was chosen.
//! **Steps** 1. where the method is `auto`, settle it by what the volume is; 2. test each voxel.
//! **Guarantees** `auto` never guesses: it takes a volume of two values for the mask, a given label for a label,
//! a scan for what the preset says, and asks otherwise. A value that is not a number is never chosen.

use espalier_model::{Bits, Report, Volume};

use crate::choose::choose;
use crate::growth::Growth;
use crate::labels::{self, Labels};
use crate::params::VESSEL_FROM_HU;
use crate::trachea::SeedCandidate;
use crate::{Error, Kind, Method, Params, Preset, inspect_kind, region_grow};

/// How many labels an error lists.
const N_LISTED: usize = 20;

/// The chosen voxels, and what they are called in messages.
pub(crate) struct Selection {
    pub(crate) bits: Bits,
    pub(crate) what: String,
    /// Whether intensities have chosen them.
    pub(crate) is_of_scan: bool,
    /// What was counted and seen on the way.
    pub(crate) report: Report,
    /// How a region grew, and from where it could have.
    pub(crate) growth: Option<Growth>,
    pub(crate) seeds: Vec<SeedCandidate>,
}

impl Selection {
    pub(crate) fn of(bits: Bits, what: impl Into<String>) -> Self {
        let report = Report::default();
        Self { bits, what: what.into(), is_of_scan: false, report, growth: None, seeds: Vec::new() }
    }

    /// The same of voxels that a scan's intensities have chosen; an open end of the band is not counted.
    pub(crate) fn of_scan(bits: Bits, (lower, upper): (f64, f64), what: impl Into<String>) -> Self {
        let mut selection = Self { is_of_scan: true, ..Self::of(bits, what) };
        for (name, end) in [("band_lower", lower), ("band_upper", upper)] {
            if end.is_finite() {
                selection.report.count(name, end);
            }
        }
        selection
    }
}

pub(crate) fn select(volume: &Volume, params: &Params) -> Result<Selection, Error> {
    match wish(params) {
        Wish::Kind => {
            let kind = inspect_kind(volume);
            match params.preset.filter(|_| needs_preset(&kind, params.method)) {
                Some(preset) => select_by_preset(volume, preset, params),
                None => {
                    let background = background(kind, params.method)?;
                    Ok(Selection::of(choose(volume, is_in_mask(background)), MASK))
                }
            }
        }
        Wish::Values { is_wanted, what } => {
            let is_of_scan = params.method == Method::Threshold;
            Ok(Selection { is_of_scan, ..Selection::of(choose(volume, is_wanted), what) })
        }
        Wish::Names(labels) => select_names(volume, &labels),
        Wish::Region => region_grow::grow(volume, params),
    }
}

/// Labels of which some are given by name.
fn select_names(volume: &Volume, labels: &Labels) -> Result<Selection, Error> {
    let present = match inspect_kind(volume) {
        Kind::Labels { values } => values,
        Kind::Mask { background, foreground } => vec![background, foreground],
        Kind::Constant { value } => vec![value],
        Kind::Ct { min, max } => return Err(Error::NoLabelMap { label: labels.to_string(), min, max }),
    };
    let (values, notes) = labels::resolve(labels, &present)?;
    let mut selection = Selection::of(choose(volume, |v| values.contains(&v)), format!("label {labels}"));
    notes.into_iter().for_each(|note| selection.report.warn("W-VOLUME-LABEL-NAME", note));
    Ok(selection)
}

/// A scan by what it shows.
fn select_by_preset(volume: &Volume, preset: Preset, params: &Params) -> Result<Selection, Error> {
    if preset == Preset::Airway || params.has_seed() {
        return region_grow::grow(volume, params);
    }
    let lower = params.lower.unwrap_or(VESSEL_FROM_HU);
    let upper = params.upper.unwrap_or(f64::INFINITY);
    let bits = choose(volume, |value| (lower..=upper).contains(&value));
    let mut selection = Selection::of_scan(bits, (lower, upper), format!("the band {lower} to {upper}"));
    let message = format!("preset \"vessel\" without a seed: all from {lower} on, bone as well as vessels");
    selection.report.warn("W-VOLUME-PRESET", message);
    Ok(selection)
}

/// Whether a volume of this kind is taken for what the preset says.
pub(crate) fn needs_preset(kind: &Kind, method: Method) -> bool {
    method == Method::Auto && matches!(kind, Kind::Ct { .. })
}

/// What decides whether a voxel is chosen.
pub(crate) enum Wish {
    /// The kind of the volume, and then the voxel's value.
    Kind,
    /// The voxel's value alone.
    Values { is_wanted: Box<dyn Fn(f64) -> bool + Sync>, what: String },
    /// Its value, and all values that there are: labels by name.
    Names(Labels),
    /// Its place and the whole volume.
    Region,
}

pub(crate) fn wish(params: &Params) -> Wish {
    let (lower, upper) = params.band();
    match (params.method, &params.label) {
        (Method::Auto, None) | (Method::Mask, _) => Wish::Kind,
        (Method::Threshold, _) => Wish::Values {
            is_wanted: Box::new(move |value| (lower..=upper).contains(&value)),
            what: format!("the band {lower} to {upper}"),
        },
        (Method::RegionGrow, _) => Wish::Region,
        // `Params::validate` refuses the method `label` without one.
        (Method::Auto | Method::Label, label) => {
            let labels = label.clone().unwrap_or_else(|| Labels(Vec::new()));
            match labels.values() {
                Some(values) => Wish::Values {
                    is_wanted: Box::new(move |value| values.contains(&value)),
                    what: format!("label {labels}"),
                },
                None => Wish::Names(labels),
            }
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
            way_out: "set volume.preset = \"airway\" or \"vessel\"; or volume.method = \"region-grow\" with seed_voxel \
                      and upper (an airway: near -900 HU) or \"threshold\" with lower and upper (vessels with \
                      contrast: from 150 HU)"
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
