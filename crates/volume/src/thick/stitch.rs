//! What hung together before slices were interpolated, joined again.
//!
//! **Input** the bits of a mask, those of it on thinner slices, and where among these the old slices lie. **Output** the
//! new bits with threads added, and how many pieces have grown together that did not touch.
//! **Steps** If an old piece lies in several new ones: 1. From the old voxels that are in pieces of the new mask, walk
//! breadth first over the other old voxels: each belongs to the piece from which it was reached. 2. Every two neighbours of
//! different pieces are a way between them. Take the ways from the shortest to the longest; one that joins what nothing
//! joins yet becomes a thread of voxels, along old ones.
//! **Why?** Where a branch changes over from slice to slice at a corner between wide parts, or is thin where walls are rough,
//! nothing of it may be left between them.
//! **Guarantees** pieces that hold old voxels hang together where these did; without new pieces nothing is added.
//! **Cost** O(runs of both masks) where nothing broke, else O(voxels · log).

use espalier_geom::union_find::UnionFind;
use espalier_model::Bits;

use crate::runs::{Connectivity, Runs};

/// Where the old slices lie among the new ones.
#[derive(Clone, Copy, Debug)]
pub(super) struct Placed {
    pub(super) axis: usize,
    pub(super) factor: usize,
    /// The new slice of the first old one.
    pub(super) first: usize,
}

impl Placed {
    fn of(self, mut voxel: [usize; 3]) -> [usize; 3] {
        voxel[self.axis] = voxel[self.axis] * self.factor + self.first;
        voxel
    }
}

/// What has become of the pieces of a mask.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Stitched {
    pub(super) n_threads: usize,
    /// Old pieces less the new ones that hold them.
    pub(super) n_grown_together: usize,
}

/// Adds the threads.
pub(super) fn stitch(old: &Bits, new: &mut Bits, placed: Placed) -> Stitched {
    let runs = Runs::cut(new);
    let pieces = runs.components(Connectivity::All);
    let piece_of = |voxel: [usize; 3]| runs.find(placed.of(voxel)).map(|run| pieces.of_run[run]);
    let old_runs = Runs::cut(old);
    let old_pieces = old_runs.components(Connectivity::All);
    let mut piece_of_old: Vec<Option<usize>> = vec![None; old_pieces.n_components];
    let mut together = UnionFind::new(old_pieces.n_components);
    let mut old_of_piece: Vec<Option<usize>> = vec![None; pieces.n_components];
    let (mut is_broken, mut n_grown_together) = (false, 0);
    for voxel in old.voxels() {
        let (Some(piece), Some(run)) = (piece_of(voxel), old_runs.find(voxel)) else { continue };
        let own = old_pieces.of_run[run];
        is_broken |= *piece_of_old[own].get_or_insert(piece) != piece;
        let other = *old_of_piece[piece].get_or_insert(own);
        n_grown_together += usize::from(together.join(own, other));
    }
    if !is_broken {
        return Stitched { n_threads: 0, n_grown_together };
    }
    let walk = Walk::over(old, piece_of);
    let mut sets = UnionFind::new(pieces.n_components);
    let mut n_threads = 0;
    for (_, ends) in walk.ways() {
        let [a, b] = ends.map(|end| walk.places[end].piece as usize);
        if sets.join(a, b) {
            n_threads += 1;
            let [mut way, back] = ends.map(|end| walk.way_from(end));
            way.reverse();
            way.extend(back);
            way.windows(2).for_each(|step| thread(new, [placed.of(step[0]), placed.of(step[1])]));
        }
    }
    Stitched { n_threads, n_grown_together }
}

/// An old voxel that was reached.
#[derive(Clone, Copy)]
struct Place {
    voxel: [u32; 3],
    piece: u32,
    /// Steps from a voxel of the piece, and the place of the one before.
    n_steps: u32,
    before: u32,
}

impl Place {
    fn voxel(&self) -> [usize; 3] {
        self.voxel.map(|v| v as usize)
    }
}

/// What the walk holds for each old voxel, in bytes.
pub(super) const BYTES_PER_VOXEL: usize = size_of::<Place>() + size_of::<u32>();

struct Walk<'a> {
    old: &'a Bits,
    /// In the order in which they were reached.
    places: Vec<Place>,
    /// The number of ones before each word, and the place of each of the ones.
    n_before: Vec<u32>,
    place_of: Vec<u32>,
}

/// No place.
const NONE: u32 = u32::MAX;

impl<'a> Walk<'a> {
    fn over(old: &'a Bits, piece_of: impl Fn([usize; 3]) -> Option<usize>) -> Self {
        let mut n_voxels = 0;
        let count = |word: &u64| {
            let before = n_voxels;
            n_voxels += word.count_ones();
            before
        };
        let n_before: Vec<u32> = old.words().iter().map(count).collect();
        let mut walk = Self { old, places: Vec::new(), n_before, place_of: vec![NONE; n_voxels as usize] };
        for voxel in old.voxels() {
            if let Some(piece) = piece_of(voxel) {
                let before = walk.places.len() as u32;
                walk.reach(Place { voxel: voxel.map(|v| v as u32), piece: piece as u32, n_steps: 0, before });
            }
        }
        let mut next = 0;
        while next < walk.places.len() {
            let place = walk.places[next];
            for other in neighbours(old, place.voxel()) {
                let voxel = other.map(|v| v as u32);
                walk.reach(Place { voxel, n_steps: place.n_steps + 1, before: next as u32, ..place });
            }
            next += 1;
        }
        walk
    }

    fn reach(&mut self, place: Place) {
        let number = self.number(place.voxel());
        if self.place_of[number] == NONE {
            self.place_of[number] = self.places.len() as u32;
            self.places.push(place);
        }
    }

    fn number(&self, [x, y, z]: [usize; 3]) -> usize {
        let word = (z * self.old.shape()[1] + y) * self.old.words_per_row() + x / 64;
        let lower = self.old.words()[word] & ((1 << (x % 64)) - 1);
        (self.n_before[word] + lower.count_ones()) as usize
    }

    /// Every two places beside each other that belong to different pieces, the shortest way first.
    fn ways(&self) -> Vec<(u32, [usize; 2])> {
        let mut ways = Vec::new();
        for (index, place) in self.places.iter().enumerate() {
            for other in neighbours(self.old, place.voxel()) {
                let there = self.place_of[self.number(other)] as usize;
                if index < there && self.places[there].piece != place.piece {
                    ways.push((place.n_steps + self.places[there].n_steps, [index, there]));
                }
            }
        }
        ways.sort_unstable();
        ways
    }

    /// The voxels from a place back to its piece.
    fn way_from(&self, mut place: usize) -> Vec<[usize; 3]> {
        let mut way = vec![self.places[place].voxel()];
        while self.places[place].before as usize != place {
            place = self.places[place].before as usize;
            way.push(self.places[place].voxel());
        }
        way
    }
}

/// The foreground among the 26 neighbours of a voxel.
fn neighbours(bits: &Bits, voxel: [usize; 3]) -> impl Iterator<Item = [usize; 3]> + use<'_> {
    let center = voxel.map(|v| v as i64);
    (0..27).filter(|&i| i != 13).filter_map(move |i| {
        let at = [center[0] + i % 3 - 1, center[1] + i / 3 % 3 - 1, center[2] + i / 9 - 1];
        bits.contains(at).then(|| at.map(|v| v as usize))
    })
}

/// Sets the voxels next to the straight line between two.
fn thread(bits: &mut Bits, [from, to]: [[usize; 3]; 2]) {
    let n_steps = [0, 1, 2].map(|axis| from[axis].abs_diff(to[axis])).into_iter().max().unwrap_or(0).max(1);
    for step in 0..=n_steps {
        // Half-way goes to the end.
        let at = |axis: usize| (from[axis] * (n_steps - step) + to[axis] * step + n_steps / 2) / n_steps;
        bits.set([at(0), at(1), at(2)]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two bars that touch at a corner, and one a voxel's width of the old mask away from the second.
    #[test]
    fn what_broke_is_joined_once() {
        let mut old = Bits::new([20, 5, 2]);
        (0..4).for_each(|x| old.set([x, 2, 0]));
        (4..20).for_each(|x| old.set([x, 3, 1]));
        let mut new = Bits::new([20, 5, 5]);
        (0..4).for_each(|x| new.set([x, 2, 0]));
        (4..12).chain(15..20).for_each(|x| new.set([x, 3, 4]));
        let placed = Placed { axis: 2, factor: 4, first: 0 };
        assert_eq!(stitch(&old, &mut new, placed).n_threads, 2);
        assert!((12..15).all(|x| new.get([x, 3, 4])), "along the old voxels");
        assert_eq!(Runs::cut(&new).components(Connectivity::All).n_components, 1);
        assert_eq!(stitch(&old, &mut new, placed).n_threads, 0);
    }
}
