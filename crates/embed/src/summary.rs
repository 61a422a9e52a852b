//! Counts and warnings of a run.

use espalier_model::{EditRecord, Report, WidthMode, Widths};

use crate::choices::Method;
use crate::judged::Judged;
use crate::methods;
use crate::params::Params;
use crate::problem::Problem;

/// What is said of the methods' layouts and the best of them.
pub(crate) fn of_layouts(problem: &Problem, judged: &[Judged], winner: &Judged, params: &Params) -> Report {
    let asked = params.method;
    let mut report = Report::default();
    report.count_usize("nodes", problem.n_nodes());
    report.count_usize("branches", problem.branches.list().len());
    report.count_usize("crossings", winner.certificate.crossings);
    report.count_usize("overlaps", winner.widths.overlaps);
    report.count("radius_scale_without_overlaps", winner.widths.radius_scale);
    report.count("length_scale", winner.widths.length_scale);
    report.count("area_needed_mm2", winner.widths.area_needed_mm2);
    report.count("area_available_mm2", winner.widths.area_available_mm2);
    report.count("energy", winner.scored.energy.total());
    report.count("length_loss_mean", winner.losses.length_loss_mean);
    report.count("angle3d_error_mean_deg", winner.losses.angle3d_error_mean_deg);
    report.count("evaluations", judged.iter().map(|judged| judged.evaluations as f64).sum::<f64>());
    report.count("proven_optimal", f64::from(u8::from(winner.is_optimal())));
    if params.methods.contains(&Method::Pso) && methods::is_too_large_for_swarm(problem, params) {
        report.count("pso_left_out_above_nodes", params.pso.max_nodes);
    }
    if winner.method != asked {
        let reason = match judged.iter().find(|judged| judged.method == asked) {
            Some(judged) if judged.certificate.holds() => {
                let (energy, least) = (judged.scored.energy.total(), winner.scored.energy.total());
                format!("has the energy {energy:.4}, which is higher by {:.1e}", energy - least)
            }
            Some(judged) => format!("has {} crossings", judged.certificate.crossings),
            None => "did not run".to_owned(),
        };
        let message = format!("the layout is by {}, because {} {reason}", winner.name, asked.name());
        report.warn("W-EMBED-OTHER-METHOD", message);
    }
    report
}

/// What has to be said of the result at the widths of its tubes.
pub(crate) fn warn_of_widths(problem: &Problem, widths: &Widths, report: &mut Report) {
    if !widths.is_complete {
        let message = format!(
            "the mean radius is {} mm, the median edge {} mm: too many tubes overlap to count them all; check the \
             unit of the radii",
            problem.tree.mean_radius_mm(),
            problem.scale_mm
        );
        report.warn("W-EMBED-THICK-TUBES", message);
    }
    if widths.are_impossible() {
        let Widths { area_needed_mm2, area_available_mm2, .. } = *widths;
        let message = format!(
            "the tubes need at least {area_needed_mm2:.0} mm², but with exact lengths there are only \
             {area_available_mm2:.0} mm²: no layout keeps both lengths and widths without overlaps"
        );
        report.warn("W-EMBED-NO-ROOM", message);
    }
    if widths.mode != WidthMode::Report && widths.overlaps > 0 {
        let Widths { overlaps, radius_scale, .. } = *widths;
        let message = format!("{overlaps} overlaps are left; none at {radius_scale:.3} of the radii");
        report.warn("W-EMBED-OVERLAPS", message);
    }
}

/// What is said of manual edits.
pub(crate) fn of_edits((edited, records): &(Judged, Vec<EditRecord>)) -> Report {
    let mut report = Report::default();
    report.count_usize("edits", records.len());
    report.count_usize("edits_crossings_removed", records.iter().map(|r| r.crossings_removed).sum());
    report.count_usize("overlaps_edited", edited.widths.overlaps);
    report.count("energy_edited", edited.scored.energy.total());
    report
}
