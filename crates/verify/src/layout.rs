//! What an embedding claims about its own layout, and about the methods beside it.
//!
//! **Input** tree, views, embedding, weights. **Output** one check per claim.
//! **Steps** 1. Coordinates: rounded, and in the range of exact arithmetic. 2. Meetings, by the sweep. 3. Targets.
//! 4. Ratios, then the energy made of them. 5. Losses, overlaps. 6. The rows of the other methods: that one crossing
//! costs more than any layout without, that the result is the best, that "optimal" means that nothing is lost.
//! **Cost** O(N log N), and 1.1 million distances.

use espalier_model::{
    Embedding, Energy, LossColumn, Losses, MethodRow, Termination, Tree, ViewHierarchy, WidthMode,
};
use glam::DVec2;

use crate::check::Check;
use crate::energy::{Scored, energy};
use crate::flat::{Flat, mirrored};
use crate::losses::{Loss, losses};
use crate::overlaps::Overlaps;
use crate::sweep::{Meetings, meetings};
use crate::weights::{NodeWeights, Weights};
use crate::{overlaps, pose, ratios, targets, widths};

/// Share by which a sum of many doubles may differ from the same sum in another order.
const ROUNDING: f64 = 1e-9;
/// Energies of layouts that differ by less count as equal: rounding of the coordinates can leave as much.
const EQUAL: f64 = 1e-12;
/// A turn may be off by so much from what an edit asks for: rounding of the coordinates of short edges.
const EDIT_DEG: f64 = 1e-3;
/// What the name of an edited layout adds to that of its method.
const EDITED: &str = ", edited";
/// Coordinates outside of this have no exact orientation in doubles; 0 has.
const EXACT: std::ops::RangeInclusive<f64> = 1e-80..=1e65;

/// An embedding and what it was made from, all as read from files.
#[derive(Clone, Copy, Debug)]
pub struct Claim<'a> {
    /// The tree.
    pub tree: &'a Tree,
    /// Its views, where they are at hand.
    pub views: Option<&'a ViewHierarchy>,
    /// The embedding.
    pub embedding: &'a Embedding,
    /// The weights of the energy.
    pub weights: &'a Weights,
    /// Whether the result has to be the best of all methods that ran: not if a constructive method was asked for.
    pub must_be_best: bool,
}

/// Checks every claim of an embedding.
///
/// # Panics
/// If the embedding is not of this tree, by the number of its nodes.
#[must_use]
pub fn check_embedding(claim: &Claim<'_>) -> Vec<Check> {
    let Claim { tree, views, embedding, weights, .. } = *claim;
    let branches = tree.branches();
    let mut checks = vec![
        Check::same("tree", embedding.tree.as_str(), tree.digest()),
        check_rounding(embedding),
        check_range(&embedding.positions_mm),
    ];
    if checks.iter().any(Check::fails) {
        return checks;
    }
    checks.extend(check_meetings(tree, embedding));
    checks.extend(targets::check(tree, views, &embedding.targets));

    // Everything is measured in the handedness of the targets.
    let is_reflected = embedding.pose.is_reflected;
    let positions =
        if is_reflected { mirrored(&embedding.positions_mm) } else { embedding.positions_mm.clone() };
    let flat = Flat::new(tree, &positions);
    checks.extend(check_ratios(tree, embedding, &flat));
    let scored = Scored {
        tree,
        branches: &branches,
        targets: &embedding.targets,
        flat: &flat,
        length_ratio: &embedding.length_ratio,
        angle_ratio: &embedding.angle_ratio,
    };
    checks.extend(check_energy(
        &embedding.energy,
        &energy(&scored, &NodeWeights::new(tree, &branches, weights)),
    ));
    checks.extend(check_losses(
        &embedding.losses,
        &losses((tree, &branches), &embedding.targets, (&flat, &positions)),
    ));
    checks.extend(pose::check_pose(tree, embedding));
    checks.push(pose::check_trace(embedding));
    let overlaps = overlaps::count(tree, &branches, &embedding.positions_mm);
    checks.extend(widths::check((tree, &branches), embedding, &overlaps));
    checks.extend(check_rows(claim, &overlaps));
    checks
}

fn check_rounding(embedding: &Embedding) -> Check {
    let quantum_mm = embedding.quantum_mm;
    let exponent = format!("{quantum_mm:e}");
    let power = exponent.strip_prefix("1e").unwrap_or("not a power of ten");
    // The nearest double of a whole number of steps, through the decimal text: what a reader makes of the file.
    let is_rounded = |value: f64| {
        let steps = (value / quantum_mm).round();
        format!("{steps:.0}e{power}").parse() == Ok(value)
    };
    let stray = embedding.positions_mm.iter().position(|p| !(is_rounded(p.x) && is_rounded(p.y)));
    let fault = stray.map(|node| format!("node {node}: {}", embedding.positions_mm[node]));
    Check::unless("coordinates", format!("rounded to {exponent} mm"), fault)
}

fn check_range(positions: &[DVec2]) -> Check {
    let is_exact = |value: f64| value == 0.0 || EXACT.contains(&value.abs());
    let stray = positions.iter().position(|p| !(is_exact(p.x) && is_exact(p.y)));
    let fault = stray.map(|node| format!("node {node}: {:e}, {:e}", positions[node].x, positions[node].y));
    Check::unless("range of exact arithmetic", "1e-80 to 1e65 mm", fault)
}

fn check_meetings(tree: &Tree, embedding: &Embedding) -> Vec<Check> {
    let found = meetings(tree, &embedding.positions_mm);
    let certificate = &embedding.certificate;
    let fault = (found.count > 0).then(|| {
        let more = if found.is_complete { "" } else { " or more" };
        let (a, b) = found.pairs.first().copied().unwrap_or_default();
        format!("{}{more}, first between edges {a} and {b}", found.count)
    });
    let stray = certificate.pairs.iter().find(|&&(a, b)| {
        found.pairs.len() < Meetings::LISTED && !found.pairs.contains(&(a.min(b), a.max(b)))
    });
    vec![
        Check::unless("crossings", 0, fault),
        Check::same("certificate", certificate.crossings, found.count),
        Check::unless(
            "certificate's pairs",
            certificate.pairs.len(),
            stray.map(|(a, b)| format!("edges {a} and {b} do not meet")),
        ),
    ]
}

fn check_ratios(tree: &Tree, embedding: &Embedding, flat: &Flat) -> [Check; 2] {
    let Embedding { targets, quantum_mm, .. } = embedding;
    [
        ratios::check_lengths(targets, flat, *quantum_mm, &embedding.length_ratio),
        ratios::check_angles((tree, targets), flat, *quantum_mm, &embedding.angle_ratio),
    ]
}

fn check_energy(stated: &Energy, found: &Energy) -> Vec<Check> {
    [
        ("energy of lengths", stated.length, found.length),
        ("energy of angles", stated.angle, found.angle),
        ("energy of sides", stated.side, found.side),
        ("energy of placement", stated.placement, found.placement),
    ]
    .map(|(name, stated, found)| Check::near(name, stated, found, ROUNDING * found.abs().max(1.0)))
    .into()
}

/// Every loss that is stated, in its order, beside what was found.
fn check_losses(stated: &Losses, found: &[Loss]) -> Vec<Check> {
    let check = |column: &LossColumn| {
        let (name, stated) = (column.column.name, (column.of)(stated));
        match found.iter().find(|loss| loss.name == name) {
            Some(loss) => Check::near(name, stated, loss.value, loss.tolerance),
            None => Check::untested(name, stated, "no second way to it is known here"),
        }
    };
    Losses::COLUMNS.iter().map(check).collect()
}

/// Checks what is said about all methods together.
fn check_rows(claim: &Claim<'_>, overlaps: &Overlaps) -> Vec<Check> {
    let Claim { embedding, weights, .. } = *claim;
    // A method may have run twice, the second time against other targets.
    let is_own = |row: &&MethodRow| row.method == embedding.method && row.targets == embedding.targets.kind;
    let Some(own) = embedding.methods.iter().find(is_own) else {
        let names: Vec<&str> = embedding.methods.iter().map(|row| row.method.as_str()).collect();
        return vec![Check::same("method", embedding.method.as_str(), names.join(", "))];
    };
    let is_same = own.energy == embedding.energy
        && own.losses == embedding.losses
        && own.crossings == embedding.certificate.crossings;
    let fault = (!is_same).then(|| format!("the row of {} says something else", own.method));
    vec![
        Check::unless("row of the result", own.method.as_str(), fault),
        check_overlaps(own, overlaps),
        check_crossing_weight(&embedding.methods, weights.crossing),
        check_best(claim, own),
        check_optimal(embedding),
    ]
    .into_iter()
    .chain(check_edits(claim, own))
    .collect()
}

fn check_overlaps(own: &MethodRow, found: &Overlaps) -> Check {
    let Overlaps { certain, open, is_complete, .. } = *found;
    if !is_complete {
        return Check::untested("overlaps", own.overlaps, "too many tubes overlap to count them");
    }
    let is_within = (certain..=certain + open).contains(&own.overlaps);
    Check::same("overlaps", own.overlaps, if is_within { own.overlaps } else { certain })
}

/// One crossing has one price, which is more than any layout without crossings costs.
fn check_crossing_weight(rows: &[MethodRow], stated: Option<f64>) -> Check {
    let mut price = stated;
    let mut fault = None;
    for row in rows {
        let paid = row.energy.crossing;
        let own = if row.crossings > 0 { Some(paid / row.crossings as f64) } else { None };
        let is_free = row.crossings == 0 && paid == 0.0;
        let is_one_price = own.zip(price).is_none_or(|(a, b)| (a - b).abs() <= ROUNDING * b);
        price = price.or(own);
        if !(is_free || own.is_some() && is_one_price) {
            fault = Some(format!("{} pays {paid} for {} crossings", row.method, row.crossings));
        }
    }
    if let (None, Some(price)) = (stated, price) {
        let dearest = rows.iter().find(|row| row.energy.total() - row.energy.crossing >= price);
        fault = fault.or(dearest.map(|row| format!("{} costs more without its crossings", row.method)));
    }
    let price = price.map_or_else(|| "no crossing".to_owned(), |price| format!("{price:.6} each"));
    Check::unless("price of crossings", price, fault)
}

/// No certified layout with the same targets has a lower energy; of an edited layout or one that gave way to widths,
/// than the one it was made of.
fn check_best(claim: &Claim<'_>, own: &MethodRow) -> Check {
    let rows = &claim.embedding.methods;
    let name = "never worse";
    let origin = origin(claim.embedding, own);
    let best = if origin == own.method { Some(own) } else { rows.iter().find(|row| row.method == origin) };
    let Some(best) = best else {
        return Check::unless(name, own.method.as_str(), Some(format!("{origin} is no row")));
    };
    let energy = best.energy.total();
    let rivals = rows.iter().filter(|row| row.crossings == 0 && row.targets == best.targets);
    let rivals = rivals.filter(|row| !std::ptr::eq(*row, own));
    let better = rivals.min_by(|a, b| a.energy.total().total_cmp(&b.energy.total()));
    let better = better.filter(|row| row.energy.total() + EQUAL * energy.max(1.0) < energy);
    let fault = better.map(|row| format!("{} has {:.9}", row.method, row.energy.total()));
    if claim.must_be_best {
        Check::unless(name, format!("{energy:.9} of {origin} is the least energy"), fault)
    } else {
        Check::untested(name, own.method.as_str(), "the method was asked for by name")
    }
}

/// The method whose layout was edited or gave way to widths; the row's own where nothing was done to it.
fn origin<'a>(embedding: &Embedding, own: &'a MethodRow) -> &'a str {
    let mut origin = own.method.as_str();
    if !embedding.edits.is_empty() {
        origin = origin.strip_suffix(EDITED).unwrap_or(origin);
    }
    let suffix = match embedding.widths.mode {
        WidthMode::Report => return origin,
        WidthMode::Avoid => "-avoid",
        WidthMode::Stretch => "-stretch",
    };
    origin.strip_suffix(suffix).unwrap_or(origin)
}

/// The edits begin with a layout of the table and end with the embedding, and keep what they ask for.
fn check_edits(claim: &Claim<'_>, own: &MethodRow) -> Option<Check> {
    let edits = &claim.embedding.edits;
    let (first, last) = (edits.first()?, edits.last()?);
    let name = own.method.strip_suffix(EDITED).unwrap_or_default();
    let base = claim.embedding.methods.iter().find(|row| row.method == name);
    let differs = |a: f64, b: f64| (a - b).abs() > EQUAL * a.abs().max(1.0);
    let broken = edits.windows(2).position(|pair| differs(pair[0].energy_after, pair[1].energy_before));
    let missed = edits.iter().position(|record| {
        let off_deg = (record.angle_reached_deg - record.edit.angle_deg).abs();
        off_deg > EDIT_DEG || record.crossings_removed > record.crossings_introduced
    });
    let fault = if base.is_none_or(|base| differs(base.energy.total(), first.energy_before)) {
        Some("the first edit does not begin with the layout that was edited".to_owned())
    } else if differs(last.energy_after, claim.embedding.energy.total()) {
        Some("the last edit does not end with the embedding".to_owned())
    } else if let Some(idx) = broken {
        Some(format!("edits[{}] does not go on where edits[{idx}] ends", idx + 1))
    } else {
        missed.map(|idx| format!("edits[{idx}] is not kept"))
    };
    Some(Check::unless("edits", format!("{} made", edits.len()), fault))
}

/// It is called optimal where all ratios are zero and nothing crosses, and nowhere else.
fn check_optimal(embedding: &Embedding) -> Check {
    let is_lost = |ratios: &[f64]| ratios.iter().position(|&ratio| ratio != 0.0);
    let is_stated = embedding.termination == Termination::Optimal;
    let (length, angle) = (is_lost(&embedding.length_ratio), is_lost(&embedding.angle_ratio));
    let fault = match (length, angle) {
        (Some(node), _) if is_stated => Some(format!("the length of node {node} is lost")),
        (_, Some(node)) if is_stated => Some(format!("the angle of node {node} is lost")),
        _ if is_stated && embedding.certificate.crossings > 0 => Some("there are crossings".to_owned()),
        (None, None) if !is_stated && embedding.certificate.crossings == 0 => {
            Some("nothing is lost: it is optimal".to_owned())
        }
        _ => None,
    };
    Check::unless("termination", embedding.termination.name(), fault)
}
