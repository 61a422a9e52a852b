//! Skeleton voxels → a graph of hubs and pieces.
//!
//! **Input** skeleton voxels, their adjacency and inscribed spheres. **Output** [`Graph`]: *hubs* (tips, junctions)
//! and *pieces* (the voxel chains between two hubs), at the spheres' sub-voxel centres.
//! **Steps** 1. A voxel is part of a junction if it has three or more neighbours, or two that touch each other.
//! 2. Touching junction voxels are one cluster, hence one hub, at the centroid of their spheres weighted by radius.
//! 3. A voxel with at most one neighbour is a tip, a hub of its own. 4. Follow the chains of the other voxels from
//! hub to hub. 5. What is left are rings without a hub: their first voxel becomes one.
//! **Guarantees** every voxel is in exactly one hub or piece; the cycles of the graph are those of the skeleton that
//! do not lie within one junction cluster.
//! **Why not** keep triangles of touching voxels as loops? They enclose no hole of the organ.
//! **Cost** O(N) in the number of voxels.

use espalier_model::InscribedSpheres;
use glam::DVec3;

use crate::adjacency::Adjacency;

/// A place on the centreline.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Sample {
    /// RAS+ mm.
    pub(crate) position_mm: DVec3,
    /// In mm.
    pub(crate) radius_mm: f64,
}

/// A tip or a junction.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Hub {
    /// Where it is.
    pub(crate) sample: Sample,
    /// Whether a loop was opened here, so that it is no end of the organ.
    pub(crate) is_stub: bool,
    /// Whether its sphere touches the border of the scan, so that the organ goes on beyond.
    pub(crate) is_at_border: bool,
}

/// A chain between two hubs.
#[derive(Clone, Debug)]
pub(crate) struct Piece {
    /// The hubs at its ends; the same one twice for a loop at one hub.
    pub(crate) ends: [usize; 2],
    /// What lies strictly between them, in order.
    pub(crate) samples: Vec<Sample>,
}

/// Hubs and pieces.
#[derive(Clone, Debug, Default)]
pub(crate) struct Graph {
    /// The hubs.
    pub(crate) hubs: Vec<Hub>,
    /// The pieces.
    pub(crate) pieces: Vec<Piece>,
}

impl Graph {
    /// All samples of a piece, with those of its ends.
    pub(crate) fn polyline(&self, piece: usize) -> Vec<Sample> {
        let Piece { ends: [first, last], samples } = &self.pieces[piece];
        let mut polyline = Vec::with_capacity(samples.len() + 2);
        polyline.push(self.hubs[*first].sample);
        polyline.extend_from_slice(samples);
        polyline.push(self.hubs[*last].sample);
        polyline
    }

    /// The length of a piece, in mm.
    pub(crate) fn length_mm(&self, piece: usize) -> f64 {
        polyline_length_mm(&self.polyline(piece))
    }

    /// The pieces at each hub, ascending; a loop at one hub stands there twice.
    pub(crate) fn incidence(&self) -> Vec<Vec<usize>> {
        let mut incident = vec![Vec::new(); self.hubs.len()];
        for (piece_idx, piece) in self.pieces.iter().enumerate() {
            for end in piece.ends {
                incident[end].push(piece_idx);
            }
        }
        incident
    }
}

/// The length of a polyline, in mm.
pub(crate) fn polyline_length_mm(polyline: &[Sample]) -> f64 {
    polyline.windows(2).map(|pair| pair[0].position_mm.distance(pair[1].position_mm)).sum()
}

/// No hub: a voxel inside a chain.
const CHAIN: usize = usize::MAX;

/// The graph of a skeleton.
pub(crate) fn of_voxels(adjacency: &Adjacency, spheres: &InscribedSpheres) -> Graph {
    let sample = |voxel: usize| Sample {
        position_mm: spheres.0[voxel].center_mm,
        radius_mm: spheres.0[voxel].radius_mm,
    };
    let (mut members, mut hub_of) = clusters_and_tips(adjacency);
    let mut pieces = Vec::new();
    let mut is_walked = vec![false; adjacency.n_voxels()];

    for (hub, voxels) in members.iter().enumerate() {
        for &voxel in voxels {
            for &next in adjacency.neighbours(voxel) {
                let is_new_chain = hub_of[next] == CHAIN && !is_walked[next];
                // Two hubs can touch directly only if one of them is a tip; make that piece once.
                let is_direct = hub_of[next] != CHAIN && hub_of[next] > hub;
                if is_new_chain || is_direct {
                    let (last, chain) = walk(adjacency, &hub_of, voxel, next, &mut is_walked);
                    let samples = chain.into_iter().map(sample).collect();
                    pieces.push(Piece { ends: [hub, last], samples });
                }
            }
        }
    }

    for voxel in 0..adjacency.n_voxels() {
        if hub_of[voxel] == CHAIN && !is_walked[voxel] {
            let hub = members.len();
            hub_of[voxel] = hub;
            members.push(vec![voxel]);
            let next = adjacency.neighbours(voxel)[0];
            let (last, chain) = walk(adjacency, &hub_of, voxel, next, &mut is_walked);
            pieces.push(Piece { ends: [hub, last], samples: chain.into_iter().map(sample).collect() });
        }
    }

    let hubs = members
        .iter()
        .map(|voxels| Hub {
            sample: centroid(&voxels.iter().map(|&v| sample(v)).collect::<Vec<_>>()),
            is_stub: false,
            is_at_border: voxels.iter().any(|&v| spheres.0[v].is_cut),
        })
        .collect();
    Graph { hubs, pieces }
}

/// The voxels of each hub, and the hub of each voxel ([`CHAIN`] for none).
fn clusters_and_tips(adjacency: &Adjacency) -> (Vec<Vec<usize>>, Vec<usize>) {
    let n_voxels = adjacency.n_voxels();
    let is_junction = |voxel: usize| match *adjacency.neighbours(voxel) {
        [] | [_] => false,
        [a, b] => adjacency.touch(a, b),
        _ => true,
    };
    let mut hub_of = vec![CHAIN; n_voxels];
    let mut members: Vec<Vec<usize>> = Vec::new();
    for seed in 0..n_voxels {
        if hub_of[seed] != CHAIN {
            continue;
        }
        if is_junction(seed) {
            let hub = members.len();
            let mut cluster = vec![seed];
            hub_of[seed] = hub;
            let mut n_done = 0;
            while n_done < cluster.len() {
                let voxel = cluster[n_done];
                n_done += 1;
                for &next in adjacency.neighbours(voxel) {
                    if hub_of[next] == CHAIN && is_junction(next) {
                        hub_of[next] = hub;
                        cluster.push(next);
                    }
                }
            }
            members.push(cluster);
        } else if adjacency.neighbours(seed).len() <= 1 {
            hub_of[seed] = members.len();
            members.push(vec![seed]);
        }
    }
    (members, hub_of)
}

/// Follows a chain from a hub's voxel over `next` to the next hub: that hub, and the chain's voxels.
fn walk(
    adjacency: &Adjacency,
    hub_of: &[usize],
    from: usize,
    next: usize,
    is_walked: &mut [bool],
) -> (usize, Vec<usize>) {
    let (mut previous, mut voxel) = (from, next);
    let mut chain = Vec::new();
    while hub_of[voxel] == CHAIN {
        is_walked[voxel] = true;
        chain.push(voxel);
        // A chain voxel has exactly two neighbours.
        let neighbours = adjacency.neighbours(voxel);
        let onwards = if neighbours[0] == previous { neighbours[1] } else { neighbours[0] };
        (previous, voxel) = (voxel, onwards);
    }
    (hub_of[voxel], chain)
}

/// The centroid of samples weighted by radius; its radius is weighted alike.
fn centroid(samples: &[Sample]) -> Sample {
    let total: f64 = samples.iter().map(|s| s.radius_mm).sum();
    // All radii zero: count the samples alike.
    let weight = |s: &Sample| if total > 0.0 { s.radius_mm / total } else { 1.0 / samples.len() as f64 };
    Sample {
        position_mm: samples.iter().map(|s| s.position_mm * weight(s)).sum(),
        radius_mm: samples.iter().map(|s| s.radius_mm * weight(s)).sum(),
    }
}
