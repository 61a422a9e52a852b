//! What the tree stage writes for people and other programs: tables, `tree.vtp`, `tree.graphml`, `branches.nii.gz`.
//!
//! Everything is computed from the tree as it is written, so a run that begins here gives the same files.

use std::collections::BTreeMap;

use espalier_model::{
    Anatomy, InscribedSpheres, Mask, Report, Tree, graphml_out, label_table, nifti_out, vtp_out,
};
use espalier_tree::{LabelMap, MeasureContext, Params};

use crate::error::Error;

/// The share of a voxel that radii are known to at least: differences below are no narrowing. Radii of tubes of known
/// width are right to a fifth of a voxel on average; twice that and a little.
const RADIUS_RESOLUTION: f64 = 0.5;

/// What the tree was made from, beside itself.
pub(crate) struct Made<'a> {
    pub(crate) tree: &'a Tree,
    /// Mask and spheres; none of a traced tree.
    pub(crate) scan: Option<(&'a Mask, &'a InscribedSpheres)>,
    pub(crate) labels: Option<LabelMap>,
    pub(crate) params: &'a Params,
}

/// The files, by name; counts and warnings go to `report`.
pub(crate) fn files(
    made: &Made<'_>,
    report: &mut Report,
    failed: impl Fn(nifti_out::NiftiOutError) -> Error,
) -> Result<Vec<(String, Vec<u8>)>, Error> {
    let context = MeasureContext {
        spheres: made.scan.map(|(_, spheres)| spheres),
        resolution_mm: made
            .scan
            .map_or(0.0, |(mask, _)| RADIUS_RESOLUTION * mask.grid().spacing_mm().max_element()),
        stenosis_percent: made.params.stenosis_percent,
        labels: made.labels.as_ref(),
    };
    let mut anatomy = espalier_tree::measure(made.tree, &context);
    let mut files = Vec::new();
    if let Some((mask, _)) = made.scan.filter(|_| made.params.branch_volume) {
        let values = espalier_tree::branch_voxels(mask, made.tree);
        count_voxels(&mut anatomy, mask, &values, report);
        files.push(("branches.nii.gz", nifti_out::labels(mask, &values).map_err(failed)?));
        // The colours of the pictures.
        let colors = espalier_render::branch_colors(made.tree);
        files.push(("branches.ctbl", label_table::slicer_colors(&colors).into_bytes()));
        files.push(("branches.label.txt", label_table::snap_labels(&colors).into_bytes()));
    }
    describe(&anatomy, made, report);
    let texts = [
        ("branches.tsv", anatomy.branches_tsv()),
        ("generations.tsv", anatomy.generations_tsv()),
        ("profiles.tsv", anatomy.profiles_tsv()),
        ("stenoses.tsv", anatomy.stenoses_tsv()),
        ("tree.vtp", vtp_out::write(made.tree, &anatomy)),
        ("tree.graphml", graphml_out::write(made.tree, &anatomy)),
    ];
    files.extend(texts.map(|(name, text)| (name, text.into_bytes())));
    Ok(files.into_iter().map(|(name, bytes)| (name.to_owned(), bytes)).collect())
}

/// How many voxels each branch has.
fn count_voxels(anatomy: &mut Anatomy, mask: &Mask, values: &[u32], report: &mut Report) {
    let mut counts = vec![0_usize; anatomy.branches.len() + 1];
    values.iter().for_each(|&value| counts[value as usize] += 1);
    for (branch, &count) in anatomy.branches.iter_mut().zip(&counts[1..]) {
        branch.n_voxels = Some(count);
        branch.mask_volume_mm3 = count as f64 * mask.grid().voxel_volume_mm3();
    }
    report.count_usize("voxels_without_branch", counts[0]);
    report.count_usize("branches_without_voxel", counts[1..].iter().filter(|&&count| count == 0).count());
}

fn describe(anatomy: &Anatomy, made: &Made<'_>, report: &mut Report) {
    report.count_usize("stenosis_candidates", anatomy.stenoses.len());
    if made.labels.is_none() {
        return;
    }
    let mut by_label: BTreeMap<i64, usize> = BTreeMap::new();
    let regions = anatomy.branches.iter().filter_map(|branch| branch.region.as_ref());
    regions.for_each(|region| *by_label.entry(region.label).or_default() += 1);
    let n_labelled: usize = by_label.values().sum();
    report.count_usize("labels_used", by_label.len());
    report.count_usize("branches_without_label", anatomy.branches.len() - n_labelled);
    if n_labelled == 0 {
        let message = format!(
            "no branch lies within {} mm of a label: the label map may be of another space",
            made.params.label_reach_mm
        );
        report.warn("W-TREE-LABELS", message);
    }
}
