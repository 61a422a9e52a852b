//! A neuron: a soma, dendrites and an axon that wander, fork and avoid each other.
//!
//! **Input** `n_nodes`, a seed. **Output** [`Shape`] in mm, at the scale of a neuron: steps of 4 µm.
//! **Notation** a tip is an end that still grows.
//! **Steps** 1. stems leave the soma in well-spread directions; 2. the tips take turns: each steps on in the freest
//! of a few directions near its own, forks while the tree has fewer tips than one in [`NODES_PER_TIP`] nodes, or
//! now and then rests for good; 3. stop at exactly `n_nodes`; 4. radii from the tips inwards.
//! **Guarantees** exactly `n_nodes` nodes, no two nearer than a quarter of a step; every node but the soma has at most
//! two children; r^(3/2) of a parent is the sum of its children's up to a greatest radius [Rall1959].
//! **Cost** O(n_nodes log n_nodes).

use std::collections::{BTreeMap, VecDeque};
use std::f64::consts::TAU;

use espalier_geom::math;
use espalier_geom::random::{Purpose, Stream};
use espalier_geom::space::{half_sphere, plane_axes};
use espalier_model::Node;
use glam::DVec3;

use crate::Error;
use crate::shape::Shape;

/// The step to which a neuron's positions and radii are rounded, in mm: a nanometre.
pub(crate) const QUANTUM_MM: f64 = 1e-6;
/// Length of a step in mm.
const STEP_MM: f64 = 0.004;
/// Radius of the soma in mm.
const SOMA_RADIUS_MM: f64 = 0.007;
/// Radius of a tip, and the greatest radius of a neurite, in mm.
const NEURITE_RADIUS_MM: [f64; 2] = [0.000_3, 0.002_5];
/// Stems, the axon among them.
const N_STEMS: usize = 6;
/// One tip is wanted for so many nodes in a neuron of 235 nodes. It grows with the fourth root of the number of
/// nodes, since larger tracings have longer branches: 3 % of the nodes of a large neuron are tips.
const NODES_PER_TIP: f64 = 11.0;
/// The fewest steps between two forks, as a share of the nodes per tip.
const MIN_BRANCH_SHARE: f64 = 0.33;
/// Directions compared for a step.
const N_CANDIDATES: u32 = 5;
/// The size of a cell of the neighbour search, in mm: as far as a tip feels others.
const CELL_MM: f64 = 0.012;
/// SWC structure types.
const SOMA: i32 = 1;
const AXON: i32 = 2;
const DENDRITE: i32 = 3;

/// An end that still grows.
struct Tip {
    node: usize,
    direction: DVec3,
    /// Steps since the last fork.
    n_steps: u32,
    kind: i32,
}

/// The neuron while it grows.
struct Growth {
    shape: Shape,
    cells: BTreeMap<[i32; 3], Vec<usize>>,
    stream: Stream,
}

/// Grows the neuron of a seed to exactly `n_nodes` nodes.
pub(crate) fn shape(n_nodes: usize, seed: u64) -> Result<Shape, Error> {
    let mut growth = Growth {
        shape: Shape::default(),
        cells: BTreeMap::new(),
        stream: Stream::new(seed, Purpose::PhantomShape, 0, 0),
    };
    let soma = growth.place(None, DVec3::ZERO, SOMA);
    let mut tips = growth.stems(soma);
    let mut n_tips = tips.len();
    let nodes_per_tip = NODES_PER_TIP * math::pow((n_nodes as f64 / 235.0).max(1.0), 0.25);
    while growth.shape.nodes.len() < n_nodes {
        let n_grown = growth.shape.nodes.len();
        let Some(mut tip) = tips.pop_front() else {
            return Err(Error::NoPlace { kind: "neuron", n_grown, n_wanted: n_nodes });
        };
        if !growth.step(&mut tip) {
            // Boxed in. The last tips turn on the spot rather than die, so that the count is reached.
            if tips.len() < 2 {
                tip.direction = growth.any_direction();
                tips.push_back(tip);
            }
            continue;
        }
        let wants_fork = n_tips as f64 * nodes_per_tip < n_grown as f64
            && f64::from(tip.n_steps) >= MIN_BRANCH_SHARE * nodes_per_tip;
        if wants_fork && growth.stream.unit() < 0.3 {
            n_tips += 1;
            tips.extend(growth.fork(&tip));
        } else if tips.len() < 5 || growth.stream.unit() > 0.006 {
            tips.push_back(tip);
        }
    }
    growth.thicken();
    Ok(growth.shape)
}

impl Growth {
    fn place(&mut self, parent: Option<usize>, at: DVec3, kind: i32) -> usize {
        let node = self.shape.nodes.len();
        self.shape.nodes.push(Node { position_mm: at, radius_mm: NEURITE_RADIUS_MM[0], parent, kind });
        self.cells.entry(cell(at)).or_default().push(node);
        node
    }

    /// The stems: evenly spread over the sphere, turned at random; the last one is the axon.
    fn stems(&mut self, soma: usize) -> VecDeque<Tip> {
        let pole = self.any_direction();
        let (right, up) = plane_axes(pole, DVec3::Z);
        half_sphere(N_STEMS)
            .enumerate()
            .map(|(stem_idx, d)| {
                // Every other one below the equator.
                let z = if stem_idx % 2 == 0 { d.z } else { -d.z };
                let direction = d.x * right + d.y * up + z * pole;
                let is_axon = stem_idx == N_STEMS - 1;
                Tip { node: soma, direction, n_steps: 0, kind: if is_axon { AXON } else { DENDRITE } }
            })
            .collect()
    }

    fn any_direction(&mut self) -> DVec3 {
        let z = self.stream.uniform(-1.0, 1.0);
        let ring = (1.0 - z * z).sqrt();
        let around = math::unit_vector(TAU * self.stream.unit());
        DVec3::new(ring * around.x, ring * around.y, z)
    }

    /// Moves a tip on by one node: the freest of a few wandering directions. False if none is free.
    fn step(&mut self, tip: &mut Tip) -> bool {
        let from = self.shape.nodes[tip.node].position_mm;
        let is_stem = tip.node == 0;
        let length = if is_stem { SOMA_RADIUS_MM + STEP_MM } else { STEP_MM * self.stream.uniform(0.7, 1.3) };
        // Axons run straighter than dendrites; both are drawn away from the soma.
        let wander = if tip.kind == AXON { 0.28 } else { 0.40 };
        let outwards = from.normalize_or(tip.direction);
        let mut best: Option<(f64, DVec3)> = None;
        for _ in 0..N_CANDIDATES {
            let jolt = self.any_direction() * wander;
            let direction = (tip.direction + jolt + 0.08 * outwards).normalize_or(tip.direction);
            let room = self.room(from + length * direction, tip.node);
            let score = room + 0.5 * CELL_MM * direction.dot(tip.direction);
            if room > 0.25 * STEP_MM && best.is_none_or(|(highest, _)| score > highest) {
                best = Some((score, direction));
            }
        }
        let Some((_, direction)) = best else { return false };
        tip.node = self.place(Some(tip.node), from + length * direction, tip.kind);
        tip.direction = direction;
        tip.n_steps += 1;
        true
    }

    /// The distance from a point to the nearest node but `own`, at most a cell.
    fn room(&self, at: DVec3, own: usize) -> f64 {
        let [x, y, z] = cell(at);
        let mut room = CELL_MM;
        for neighbour in (0..27).map(|i| [x + i % 3 - 1, y + i / 3 % 3 - 1, z + i / 9 - 1]) {
            for &node in self.cells.get(&neighbour).into_iter().flatten().filter(|&&node| node != own) {
                room = room.min(self.shape.nodes[node].position_mm.distance(at));
            }
        }
        room
    }

    /// Two tips in place of one, to either side of its direction.
    fn fork(&mut self, tip: &Tip) -> [Tip; 2] {
        let (right, up) = plane_axes(tip.direction, DVec3::Z);
        let around = math::unit_vector(TAU * self.stream.unit());
        let side = around.x * right + around.y * up;
        // One child keeps more of the direction than the other.
        let split = self.stream.uniform(0.7, 1.2);
        let share = self.stream.uniform(0.25, 0.5);
        [share, share - 1.0].map(|part| {
            let (sin, cos) = math::sin_cos(part * split);
            Tip { node: tip.node, direction: cos * tip.direction + sin * side, n_steps: 0, kind: tip.kind }
        })
    }

    /// Radii by Rall's power law: r = r_tip · tips^(2/3), up to the greatest.
    fn thicken(&mut self) {
        let nodes = &mut self.shape.nodes;
        let mut n_tips = vec![0_u32; nodes.len()];
        for node in (1..nodes.len()).rev() {
            n_tips[node] = n_tips[node].max(1);
            nodes[node].radius_mm = (NEURITE_RADIUS_MM[0] * math::pow(f64::from(n_tips[node]), 2.0 / 3.0))
                .min(NEURITE_RADIUS_MM[1]);
            if let Some(parent) = nodes[node].parent {
                n_tips[parent] += n_tips[node];
            }
        }
        nodes[0].radius_mm = SOMA_RADIUS_MM;
    }
}

fn cell(at: DVec3) -> [i32; 3] {
    (at / CELL_MM).floor().as_ivec3().to_array()
}
