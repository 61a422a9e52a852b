//! Which skeleton voxels touch.
//!
//! **Input** [`Skeleton`], its voxels in storage order. **Output** for each voxel its 26-neighbours in the
//! skeleton, in storage order.
//! **Steps** give each voxel a key that grows in storage order on a grid padded by one voxel; a neighbour's key is
//! the voxel's plus a constant, so 26 cursors, one for each constant, walk the sorted list once.
//! **Cost** O(26 · N) time, O(N) memory, no hashing.

use espalier_model::Skeleton;

/// The 26-neighbours of each skeleton voxel.
pub(crate) struct Adjacency {
    offsets: Vec<usize>,
    list: Vec<usize>,
}

impl Adjacency {
    /// The adjacency of a skeleton.
    pub(crate) fn of(skeleton: &Skeleton) -> Self {
        let [nx, ny, _] = skeleton.grid().shape();
        let (row, slice) = (nx as i128 + 2, (nx as i128 + 2) * (ny as i128 + 2));
        let keys: Vec<i128> = skeleton
            .voxels()
            .iter()
            .map(|&[x, y, z]| i128::from(z) * slice + i128::from(y) * row + i128::from(x))
            .collect();
        let shifts: Vec<i128> = (-1..=1)
            .flat_map(|dz| (-1..=1).flat_map(move |dy| (-1..=1).map(move |dx| dz * slice + dy * row + dx)))
            .filter(|&shift| shift != 0)
            .collect();

        let mut cursors = vec![0; shifts.len()];
        let (mut offsets, mut list) = (vec![0], Vec::new());
        for &key in &keys {
            for (cursor, &shift) in cursors.iter_mut().zip(&shifts) {
                while *cursor < keys.len() && keys[*cursor] < key + shift {
                    *cursor += 1;
                }
                if keys.get(*cursor) == Some(&(key + shift)) {
                    list.push(*cursor);
                }
            }
            offsets.push(list.len());
        }
        Self { offsets, list }
    }

    /// The number of voxels.
    pub(crate) fn n_voxels(&self) -> usize {
        self.offsets.len() - 1
    }

    /// The neighbours of a voxel, ascending.
    pub(crate) fn neighbours(&self, voxel: usize) -> &[usize] {
        &self.list[self.offsets[voxel]..self.offsets[voxel + 1]]
    }

    /// Whether two voxels touch.
    pub(crate) fn touch(&self, a: usize, b: usize) -> bool {
        self.neighbours(a).binary_search(&b).is_ok()
    }
}
