//! The calibre that a vessel has around each place: what it would have there, were it not narrow.
//!
//! **Input** tree, branches, lines. **Output** the places of all branches outside of forks, each with its reference.
//! **Steps** 1. The places of a branch: where it leaves its fork's sphere, its nodes, where it enters the next fork's
//! sphere. What lies inside of a fork's sphere is no tube and counts for nothing. 2. For each place the largest radius
//! on the way to the root and the largest on the ways to the tips, both within `REACH` radii, the place included. 3. The
//! smaller of the two is the reference: the closing of the radius along the path. A vessel that only becomes thinner,
//! at a taper or a fork, is its own reference; where it becomes thinner and then wider again, it is the shoulder.
//! **Source** percent diameter stenosis against the diameter that is interpolated between the normal stretches before
//! and after, [Reiber1985]; the denominator of [NASCET1991] is the stretch after.
//! **Differs from the source** both shoulders are taken at the height of the lower one, so that a fork between them,
//! where the vessel steps down, does not make a stenosis; where a vessel tapers, this states less narrowing than
//! interpolation would, by half of what it tapers over the lesion.
//! **Cost** O(P log P) for P places, however many tips see a place.

use espalier_model::{Branches, Tree};

use super::line::Line;

/// How far shoulders are looked for, in largest radii of the branch: lesions of vessels are a few diameters long.
const REACH: f64 = 10.0;

/// A place on a branch outside of forks.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Place {
    pub(super) branch: usize,
    /// Index in the branch's line of the node here, or the next one outwards.
    pub(super) outer: usize,
    pub(super) from_start_mm: f64,
    pub(super) from_root_mm: f64,
    pub(super) radius_mm: f64,
    pub(super) reference_mm: f64,
    /// The place before it on the way to the root.
    pub(super) parent: Option<usize>,
}

impl Place {
    /// By how much the radius falls short of the reference, 0 to 100.
    pub(super) fn narrowing_percent(&self) -> f64 {
        if self.reference_mm > 0.0 { 100.0 * (1.0 - self.radius_mm / self.reference_mm) } else { 0.0 }
    }
}

/// The places in preorder.
pub(super) fn of(tree: &Tree, (branches, lines): (&Branches, &[Line]), from_root_mm: &[f64]) -> Vec<Place> {
    let mut places = collect(branches, lines, from_root_mm);
    let reach_mm: Vec<f64> = branches
        .list()
        .iter()
        .map(|branch| {
            let radii = branch.polyline().map(|node| tree.nodes()[node].radius_mm);
            REACH * radii.fold(0.0, f64::max)
        })
        .collect();
    let before = largest_before(&places, &reach_mm);
    let after = largest_after(&places, &reach_mm);
    for (place, (before, after)) in places.iter_mut().zip(before.into_iter().zip(after)) {
        place.reference_mm = before.min(after);
    }
    places
}

fn collect(branches: &Branches, lines: &[Line], from_root_mm: &[f64]) -> Vec<Place> {
    let mut places: Vec<Place> = Vec::new();
    // The last place on the way from the root to the end of each branch.
    let mut last_of: Vec<Option<usize>> = vec![None; lines.len()];
    for (branch_idx, (branch, line)) in branches.list().iter().zip(lines).enumerate() {
        let [start_fork_mm, end_fork_mm] = line.forks_mm;
        let (first_mm, last_mm) = (start_fork_mm, line.length_mm() - end_fork_mm);
        let mut parent = branch.parent.and_then(|parent| last_of[parent]);
        if first_mm < last_mm {
            let between = line.arcs_mm.iter().copied().filter(|&arc| arc > first_mm && arc < last_mm);
            for arc_mm in std::iter::once(first_mm).chain(between).chain([last_mm]) {
                places.push(Place {
                    branch: branch_idx,
                    outer: line.locate(arc_mm).0,
                    from_start_mm: arc_mm,
                    from_root_mm: from_root_mm[branch.hub] + arc_mm,
                    radius_mm: line.radius_mm(arc_mm),
                    reference_mm: 0.0,
                    parent,
                });
                parent = Some(places.len() - 1);
            }
        }
        last_of[branch_idx] = parent;
    }
    places
}

/// For each place the largest radius on the way to the root within reach.
fn largest_before(places: &[Place], reach_mm: &[f64]) -> Vec<f64> {
    let mut radii = Maxima::new(places.len());
    // The path from the root to the place: what lies deeper is left from earlier paths.
    let (mut path_mm, mut depth) = (vec![0.0; places.len()], vec![0; places.len()]);
    let mut largest = Vec::with_capacity(places.len());
    for (place_idx, place) in places.iter().enumerate() {
        let here = place.parent.map_or(0, |parent| depth[parent] + 1);
        depth[place_idx] = here;
        path_mm[here] = place.from_root_mm;
        radii.set(here, place.radius_mm);
        let first_mm = place.from_root_mm - reach_mm[place.branch];
        let first = path_mm[..=here].partition_point(|&known: &f64| known < first_mm);
        largest.push(radii.largest(first, here + 1));
    }
    largest
}

/// For each place the largest radius on the ways to the tips within reach.
fn largest_after(places: &[Place], reach_mm: &[f64]) -> Vec<f64> {
    let mut end: Vec<usize> = (1..=places.len()).collect();
    for place in (0..places.len()).rev() {
        if let Some(parent) = places[place].parent {
            end[parent] = end[parent].max(end[place]);
        }
    }
    // In the order of how far each looks, so that all places up to there are in, and none beyond.
    let limit_mm = |place: &Place| place.from_root_mm + reach_mm[place.branch];
    let mut by_limit: Vec<usize> = (0..places.len()).collect();
    by_limit.sort_by(|&a, &b| limit_mm(&places[a]).total_cmp(&limit_mm(&places[b])));
    let mut by_distance: Vec<usize> = (0..places.len()).collect();
    by_distance.sort_by(|&a, &b| places[a].from_root_mm.total_cmp(&places[b].from_root_mm));

    let mut radii = Maxima::new(places.len());
    let mut largest = vec![0.0; places.len()];
    let mut n_in = 0;
    for place_idx in by_limit {
        while let Some(&next) =
            by_distance.get(n_in).filter(|&&next| places[next].from_root_mm <= limit_mm(&places[place_idx]))
        {
            radii.set(next, places[next].radius_mm);
            n_in += 1;
        }
        largest[place_idx] = radii.largest(place_idx, end[place_idx]);
    }
    largest
}

/// Numbers at places of a row that can be set one by one, and the largest of any stretch; 0 where none was set.
struct Maxima {
    n_places: usize,
    /// A binary tree: the children of node i are 2 i and 2 i + 1, the places stand from `n_places` on.
    heap: Vec<f64>,
}

impl Maxima {
    fn new(n_places: usize) -> Self {
        Self { n_places, heap: vec![0.0; 2 * n_places] }
    }

    fn set(&mut self, place: usize, value: f64) {
        let mut node = place + self.n_places;
        self.heap[node] = value;
        while node > 1 {
            node /= 2;
            self.heap[node] = self.heap[2 * node].max(self.heap[2 * node + 1]);
        }
    }

    /// The largest of the places from `first` up to, not including, `end`.
    fn largest(&self, first: usize, end: usize) -> f64 {
        let (mut low, mut high, mut largest) = (first + self.n_places, end + self.n_places, 0.0_f64);
        while low < high {
            if low % 2 == 1 {
                largest = largest.max(self.heap[low]);
                low += 1;
            }
            if high % 2 == 1 {
                high -= 1;
                largest = largest.max(self.heap[high]);
            }
            low /= 2;
            high /= 2;
        }
        largest
    }
}

#[cfg(test)]
mod tests {
    use espalier_geom::random::{Purpose, Stream};

    use super::*;

    #[test]
    fn maxima_are_those_of_a_plain_search() {
        let mut stream = Stream::new(1, Purpose::PhantomShape, 0, 0);
        for n_places in [1, 2, 3, 7, 16, 33] {
            let (mut maxima, mut plain) = (Maxima::new(n_places), vec![0.0_f64; n_places]);
            for _ in 0..50 {
                let place = stream.below(n_places as u32) as usize;
                plain[place] = stream.unit();
                maxima.set(place, plain[place]);
                let first = stream.below(n_places as u32) as usize;
                for end in first..=n_places {
                    let expected = plain[first..end].iter().copied().fold(0.0, f64::max);
                    assert_eq!(maxima.largest(first, end), expected);
                }
            }
        }
    }
}
