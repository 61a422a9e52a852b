//! What the headings say: the verdict, the method, the losses, the tree.

use espalier_model::{Branches, Embedding, Tree, View};

use crate::furniture::Heading;
use crate::orientation::Orientation;
use crate::params::{Compass, Params};
use crate::reformation::params::{Slab, VolumeParams};
use crate::reformation::window::{Greys, signed};
use crate::unit::{self, LengthUnit};

/// The heading of the map.
pub(crate) fn planar(
    (tree, branches): (&Tree, &Branches),
    embedding: &Embedding,
    orientation: &Orientation,
    params: &Params,
) -> Heading {
    let losses = &embedding.losses;
    let mut verdict = vec![verdict(embedding)];
    verdict.extend(overlaps(embedding));
    verdict.extend([
        format!("method {}", embedding.method),
        format!(
            "length loss mean {}, max {}",
            percent(losses.length_loss_mean),
            percent(losses.length_loss_max)
        ),
        format!(
            "angle error in 3D mean {}, max {}",
            degrees(losses.angle3d_error_mean_deg),
            degrees(losses.angle3d_error_max_deg)
        ),
    ]);
    let mut facts = size_of(tree, branches, params);
    facts.push("a map, not a projection: it keeps lengths and bends, not directions".to_owned());
    if orientation.axes.is_some() && params.compass != Compass::None {
        let off = degrees(orientation.mean_loss_deg);
        facts.push(format!("letters at the edges: where most of it points, off by {off} on average; at branches: where they point instead"));
    }
    Heading { title: params.title.clone(), verdict, facts }
}

/// The heading of a map that shows a scan: what is seen, and how, before what the tree is.
pub(crate) fn with_scan(mut said: Heading, greys: &Greys, volume: &VolumeParams) -> Heading {
    let [low, high] = greys.range.map(signed);
    let mut facts = vec![
        "the scan along the branches, a curved planar reformation".to_owned(),
        format!("{} {low} to {high} {}", greys.name, if greys.unit == "HU" { "HU" } else { "" })
            .trim_end()
            .to_owned(),
    ];
    if volume.slab_mm > 0.0 {
        let what = match volume.slab {
            Slab::Mean => "mean",
            Slab::Mip => "maximum",
            Slab::Minip => "minimum",
        };
        facts.push(format!("{what} over a slab of {} mm", unit::text(volume.slab_mm, 3)));
    }
    facts.push("what lies off a branch may show twice, or not at all".to_owned());
    facts.append(&mut said.facts);
    Heading { facts, ..said }
}

/// Says first of all that the branches do not have their widths.
pub(crate) fn without_widths(mut said: Heading) -> Heading {
    if let Some(first) = said.verdict.first_mut() {
        first.push_str("; as lines, since the radii are too large to draw");
    }
    said
}

/// The heading of the global view.
pub(crate) fn global(tree: &Tree, branches: &Branches, view: &View, params: &Params) -> Heading {
    let title = params.title.as_ref().map(|title| format!("{title}: in space"));
    let verdict = vec![
        "the tree in space, from its best single view".to_owned(),
        format!("view loss {:.3}", view.loss),
    ];
    let mut facts = size_of(tree, branches, params);
    facts.push("an orthographic projection: branches may hide and shorten each other".to_owned());
    Heading { title, verdict, facts }
}

/// `crossings 0 (certified)`, or how many there are.
pub(crate) fn verdict(embedding: &Embedding) -> String {
    if embedding.certificate.holds() {
        "crossings 0 (certified)".to_owned()
    } else {
        format!("crossings {} (not certified)", embedding.certificate.crossings)
    }
}

/// How many pairs of branches overlap at their true widths, although their centrelines do not cross.
fn overlaps(embedding: &Embedding) -> Option<String> {
    let own = embedding.methods.iter().find(|row| row.method == embedding.method)?;
    (own.overlaps > 0).then(|| format!("{} overlaps at true width", own.overlaps))
}

/// How large the tree is, in parts.
pub(crate) fn size_of(tree: &Tree, branches: &Branches, params: &Params) -> Vec<String> {
    let length_mm = tree.length_mm();
    // A sum of many branches: 976 µm and 4723 mm read better beside the radii than 0.976 mm and 4.723 m.
    let unit = LengthUnit::choose(params.unit, 0.1 * length_mm);
    let counted = |n: usize, one: &str, many: &str| format!("{n} {}", if n == 1 { one } else { many });
    let mut parts = vec![
        counted(branches.list().len(), "branch", "branches"),
        counted(tree.n_tips(), "tip", "tips"),
        format!("length {} {}", unit::text(length_mm / unit.mm, 4), unit.sign),
    ];
    let mean_mm = tree.mean_radius_mm();
    if mean_mm > 0.0 {
        let unit = LengthUnit::choose(params.unit, mean_mm);
        parts.push(format!("mean radius {} {}", unit::text(mean_mm / unit.mm, 3), unit.sign));
    }
    parts
}

/// A share as a percentage.
pub(crate) fn percent(share: f64) -> String {
    if share.is_finite() { format!("{:.1} %", 100.0 * share) } else { "unknown".to_owned() }
}

/// An angle in degrees.
pub(crate) fn degrees(angle: f64) -> String {
    if angle.is_finite() { format!("{angle:.1}°") } else { "unknown".to_owned() }
}
