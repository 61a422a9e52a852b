//! What `compare.json` says of every layout of the run.
//!
//! **Input** the claim, the comparison. **Output** a check per layout, and that all belong together.
//! **Steps** per layout: meetings by the sweep, overlaps, losses, and the energy from ratios that are measured here; a
//! deviation that rounding explains counts as none. The layout is scored as it is or as its mirror image, whichever
//! agrees: the mirror of the whole is free. **Cost** as `layout`, for each method.

use espalier_model::{Branches, ComparedLayout, Comparison, Losses, MethodRow};

use crate::check::Check;
use crate::energy::{Scored, energy};
use crate::flat::{Flat, mirrored};
use crate::layout::Claim;
use crate::losses::losses;
use crate::overlaps;
use crate::pose::fault_of_trace;
use crate::ratios;
use crate::sweep::meetings;
use crate::weights::NodeWeights;

/// Share by which an energy may be off.
const ROUNDING: f64 = 1e-9;
/// The same of the end of a convergence curve, which was taken before coordinates were rounded: edges a millionth as long as
/// the tree turn by up to this much.
const TRACE_ROUNDING: f64 = 1e-5;

/// Checks every layout of a comparison.
///
/// # Panics
/// If a layout is not of the claim's tree, by the number of its nodes.
#[must_use]
pub fn check_comparison(claim: &Claim<'_>, comparison: &Comparison) -> Vec<Check> {
    let Claim { tree, embedding, weights, .. } = *claim;
    let branches = tree.branches();
    let weights = NodeWeights::new(tree, &branches, weights);
    let chosen = &comparison.layouts[comparison.chosen];
    let is_result = chosen.positions_mm == embedding.positions_mm && chosen.row.method == embedding.method;
    let rows: Vec<&MethodRow> = comparison.layouts.iter().map(|layout| &layout.row).collect();
    let mut checks = vec![
        Check::same("targets", comparison.targets.as_str(), embedding.targets.digest()),
        Check::unless(
            "chosen",
            chosen.row.method.as_str(),
            (!is_result).then(|| "not the layout of the embedding".to_owned()),
        ),
        Check::unless(
            "rows",
            rows.len(),
            (!rows.iter().copied().eq(&embedding.methods)).then(|| "not those of the embedding".to_owned()),
        ),
    ];
    let is_curve = |layout: &ComparedLayout| layout.trace == embedding.trace;
    let has_curve = embedding.trace.is_empty() || comparison.layouts.iter().any(is_curve);
    checks.push(Check::unless(
        "trace of the result",
        format!("{} points", embedding.trace.len()),
        (!has_curve).then(|| "not that of any layout".to_owned()),
    ));
    for layout in &comparison.layouts {
        let scored = Compared { claim, branches: &branches, weights: &weights, layout };
        let stated = format!("{} crossings, energy {:.6}", layout.row.crossings, layout.row.energy.total());
        let name = format!("layout of {}", layout.row.method);
        let fault = scored.fault();
        checks.push(if fault.is_none() && scored.has_other_targets() {
            Check::untested(name, stated, "crossings and overlaps hold; its targets are not in the files")
        } else {
            Check::unless(name, stated, fault)
        });
    }
    checks
}

struct Compared<'a> {
    claim: &'a Claim<'a>,
    branches: &'a Branches,
    weights: &'a NodeWeights,
    layout: &'a ComparedLayout,
}

impl Compared<'_> {
    /// Whether the row was scored against targets that are not in the files.
    fn has_other_targets(&self) -> bool {
        self.layout.row.targets != self.claim.embedding.targets.kind
    }

    fn fault(&self) -> Option<String> {
        let ComparedLayout { row, positions_mm, .. } = self.layout;
        let found = meetings(self.claim.tree, positions_mm);
        if found.is_complete && found.count != row.crossings {
            return Some(format!("{} crossings", found.count));
        }
        let overlaps = overlaps::count(self.claim.tree, self.branches, positions_mm);
        let is_within = (overlaps.certain..=overlaps.certain + overlaps.open).contains(&row.overlaps);
        if overlaps.is_complete && !is_within {
            return Some(format!("{} overlaps", overlaps.certain));
        }
        if let Some(fault) = self.fault_of_trace() {
            return Some(fault);
        }
        if self.has_other_targets() {
            return None;
        }
        let (as_is, mirrored) =
            (self.fault_of_image(positions_mm), self.fault_of_image(&mirrored(positions_mm)));
        as_is.and(mirrored)
    }

    /// A curve in no order, or one that ends elsewhere than the row says.
    fn fault_of_trace(&self) -> Option<String> {
        let ComparedLayout { row, trace, .. } = self.layout;
        let last = trace.last()?;
        let (stated, found) = (row.energy.total(), last.energy);
        let is_end = (stated - found).abs() <= TRACE_ROUNDING * stated.abs().max(1.0);
        let other_end = || format!("convergence that ends at the energy {found:.9}, stated {stated:.9}");
        let more =
            || format!("convergence over {} evaluations, stated {}", last.evaluations, row.evaluations);
        fault_of_trace(trace)
            .map(|fault| format!("convergence: {fault}"))
            .or_else(|| (!is_end).then(other_end))
            .or_else(|| (last.evaluations > row.evaluations).then(more))
    }

    /// The first number that one of the two mirror images does not have.
    fn fault_of_image(&self, positions: &[glam::DVec2]) -> Option<String> {
        let (tree, targets) = (self.claim.tree, &self.claim.embedding.targets);
        let row = &self.layout.row;
        let flat = Flat::new(tree, positions);
        let (length_ratio, angle_ratio) = ratios::measured(tree, targets, &flat, self.layout.quantum_mm);
        let branches = self.branches;
        let (length_ratio, angle_ratio) = (&length_ratio[..], &angle_ratio[..]);
        let scored = Scored { tree, branches, targets, flat: &flat, length_ratio, angle_ratio };
        let found = energy(&scored, self.weights);
        for (name, stated, found) in [
            ("of lengths", row.energy.length, found.length),
            ("of angles", row.energy.angle, found.angle),
            ("of sides", row.energy.side, found.side),
            ("of placement", row.energy.placement, found.placement),
        ] {
            let is_near = (stated - found).abs() <= ROUNDING * found.abs().max(1.0);
            if !is_near {
                return Some(format!("energy {name} {found:.9}, stated {stated:.9}"));
            }
        }
        let found = losses((tree, branches), targets, (&flat, positions));
        found.iter().find_map(|loss| {
            let column = Losses::COLUMNS.iter().find(|column| column.column.name == loss.name)?;
            let stated = (column.of)(&row.losses);
            let is_near = (stated - loss.value).abs() <= loss.tolerance;
            (!is_near).then(|| format!("{} {:.9}, stated {stated:.9}", loss.name, loss.value))
        })
    }
}
