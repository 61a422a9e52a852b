//! Narrow places.
//!
//! **Input** places with their references. **Output** one candidate for each connected stretch that is narrow, at its
//! narrowest place, the narrowest first.
//! **Steps** 1. A place is narrow if its radius falls short of its reference by the stated percentage and by what radii
//! are known to. 2. Narrow places that follow each other are one lesion.
//! **Guarantees** ties go to the place nearer to the root.
//! **Cost** O(P log P) for P places.

use espalier_model::anatomy::Stenosis;

use super::line::Line;
use super::reference::Place;

pub(super) fn find(
    lines: &[Line],
    places: &[Place],
    least_percent: f64,
    resolution_mm: f64,
) -> Vec<Stenosis> {
    let is_narrow = |place: &Place| {
        place.reference_mm - place.radius_mm >= resolution_mm.max(f64::MIN_POSITIVE)
            && place.narrowing_percent() >= least_percent
    };
    let mut lesion_of: Vec<Option<usize>> = vec![None; places.len()];
    let mut narrowest: Vec<usize> = Vec::new();
    for (place_idx, place) in places.iter().enumerate().filter(|(_, place)| is_narrow(place)) {
        let lesion = place.parent.and_then(|parent| lesion_of[parent]).unwrap_or_else(|| {
            narrowest.push(place_idx);
            narrowest.len() - 1
        });
        lesion_of[place_idx] = Some(lesion);
        if place.narrowing_percent() > places[narrowest[lesion]].narrowing_percent() {
            narrowest[lesion] = place_idx;
        }
    }
    let mut found: Vec<&Place> = narrowest.into_iter().map(|place| &places[place]).collect();
    found.sort_by(|a, b| b.narrowing_percent().total_cmp(&a.narrowing_percent()));
    found.into_iter().map(|place| candidate(&lines[place.branch], place)).collect()
}

fn candidate(line: &Line, place: &Place) -> Stenosis {
    Stenosis {
        branch: place.branch,
        node: line.nodes[place.outer],
        position_mm: line.point_mm(place.from_start_mm),
        from_root_mm: place.from_root_mm,
        radius_mm: place.radius_mm,
        reference_radius_mm: place.reference_mm,
        narrowing_percent: place.narrowing_percent(),
    }
}
