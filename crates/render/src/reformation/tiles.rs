//! Which edges the points of a tile may belong to.
//!
//! **Input** the map, its page, how far the scan is shown. **Output** by tile the edges, by lower node in preorder.
//! **Notation** h half the diagonal of a square, d the distance of its centre from an edge, r the edge's radii.
//! **Steps** From the whole page down: a square keeps the edges that a point in it may belong to, and hands them to its
//! four quarters. A point is at least d − h − max r and at most d + h − min r from the surface of a tube; an edge goes
//! where its least is over the least of all mosts, unless it is under 0, so that the point may be inside. A square
//! that is out of reach of all is empty.
//! **Guarantees** whoever a point belongs to is in the list of its tile, as long as that tube reaches the point.
//! **Cost** O(edges · levels + entries) where edges lie apart.

use espalier_geom::plane;
use glam::DVec2;

use super::params::VolumeParams;
use crate::map::{Place, PlanarMap};
use crate::page::Paper;
use crate::raster::TILE;

/// The lists.
pub(super) struct Tiles {
    n_x: usize,
    lists: Vec<Vec<u32>>,
}

/// An edge on the map.
struct Edge {
    segment: plane::Segment,
    /// The least and the largest of its radii, mm.
    radii_mm: [f64; 2],
    /// How far from its surface the scan is shown at most, mm.
    reach_mm: f64,
}

/// A square of tiles, and the edges that it has been handed.
struct Square {
    column: usize,
    row: usize,
    n_tiles: usize,
    edges: Vec<u32>,
}

impl Tiles {
    pub(super) fn sort(
        map: &PlanarMap<'_>,
        n_nodes: usize,
        paper: &Paper<'_>,
        params: &VolumeParams,
    ) -> Self {
        let [n_x, n_y] = paper.page.size().map(|n_pixels| n_pixels.div_ceil(TILE));
        let edges: Vec<Edge> = (0..n_nodes).map(|node| Edge::of(map, node, params)).collect();
        // A tree of one node is its own edge.
        let all: Vec<u32> = (u32::from(n_nodes > 1)..n_nodes as u32).collect();
        let n_tiles = n_x.max(n_y).next_power_of_two();
        let mut lists = vec![Vec::new(); n_x * n_y];
        let mut open = vec![Square { column: 0, row: 0, n_tiles, edges: all }];
        while let Some(square) = open.pop() {
            let Square { column, row, n_tiles, .. } = square;
            let kept = square.keep(&edges, paper);
            if n_tiles == 1 {
                lists[row * n_x + column] = kept;
                continue;
            }
            let half = n_tiles / 2;
            for (column, row) in
                [(column, row), (column + half, row), (column, row + half), (column + half, row + half)]
            {
                if column < n_x && row < n_y && !kept.is_empty() {
                    open.push(Square { column, row, n_tiles: half, edges: kept.clone() });
                }
            }
        }
        Self { n_x, lists }
    }

    pub(super) fn list(&self, column: usize, row: usize) -> &[u32] {
        &self.lists[row * self.n_x + column]
    }
}

impl Edge {
    fn of(map: &PlanarMap<'_>, node: usize, params: &VolumeParams) -> Self {
        let ends = [0.0, 1.0].map(|share| Place { node, share });
        let [a, b] = ends.map(|end| map.plane_at(end));
        let [from_mm, to_mm] = ends.map(|end| map.radius_mm(end));
        let radii_mm = [from_mm.min(to_mm), from_mm.max(to_mm)];
        Self { segment: plane::Segment { a, b }, radii_mm, reach_mm: params.reach(radii_mm[1]) }
    }
}

impl Square {
    /// The edges that a point of it may belong to; none if it is out of reach of them all.
    fn keep(&self, edges: &[Edge], paper: &Paper<'_>) -> Vec<u32> {
        // A pixel of slack covers rounding and the fringe of half a pixel.
        let side_px = (self.n_tiles * TILE) as f64;
        let corner = DVec2::new((self.column * TILE) as f64, (self.row * TILE) as f64);
        let center = paper.plane_mm(corner + 0.5 * side_px);
        let half_mm = (0.5 * std::f64::consts::SQRT_2 * side_px + 1.0) / paper.page.px_per_mm;
        let away = |&index: &u32| {
            let edge = &edges[index as usize];
            let nearest =
                edge.segment.a.lerp(edge.segment.b, plane::nearest_parameter(center, &edge.segment));
            center.distance(nearest)
        };
        let away: Vec<f64> = self.edges.iter().map(away).collect();
        let known = || self.edges.iter().map(|&index| &edges[index as usize]).zip(&away);
        let most =
            known().map(|(edge, away)| away + half_mm - edge.radii_mm[0]).fold(f64::INFINITY, f64::min);
        let least = |(edge, away): (&Edge, &f64)| away - half_mm - edge.radii_mm[1];
        if !known().any(|(edge, away)| least((edge, away)) <= edge.reach_mm) {
            return Vec::new();
        }
        let is_kept = known().map(|known| least(known) <= most.max(0.0));
        self.edges.iter().zip(is_kept).filter_map(|(&index, is_kept)| is_kept.then_some(index)).collect()
    }
}

#[cfg(test)]
mod tests {
    use espalier_geom::random::{Purpose, Stream};
    use espalier_model::{Node, Tree};

    use super::*;
    use crate::page::{Page, Pen};
    use crate::params::Style;

    /// A random tree, flat; its edges may lie over each other.
    fn shrub(seed: u64, n_nodes: usize) -> Tree {
        let mut stream = Stream::new(seed, Purpose::Test, 0, 0);
        let mut nodes: Vec<Node> = Vec::new();
        for i in 0..n_nodes {
            let parent = i.checked_sub(1).map(|last| last - stream.below(last.min(9) as u32 + 1) as usize);
            let from = parent.map_or(glam::DVec3::ZERO, |parent| nodes[parent].position_mm);
            let step = glam::DVec3::new(stream.uniform(-9.0, 9.0), stream.uniform(-9.0, 9.0), 0.0);
            nodes.push(Node {
                position_mm: from + step,
                radius_mm: stream.uniform(0.0, 3.0),
                parent,
                kind: 0,
            });
        }
        Tree::new(&nodes).expect("a tree")
    }

    #[test]
    fn a_tile_knows_whoever_owns_its_points() {
        for seed in 0..6 {
            let tree = shrub(seed, 120);
            let positions: Vec<DVec2> = tree.nodes().iter().map(|node| node.position_mm.truncate()).collect();
            let map = PlanarMap::new(&tree, &positions, glam::DVec3::Z);
            let pen = Pen { min_width_px: 2.0, style: Style::Volume };
            let page = Page {
                width: 300,
                height: 200,
                unit_px: 6.0,
                px_per_mm: 4.0,
                origin_px: DVec2::new(140.0, 90.0),
                area: [DVec2::ZERO; 2],
                key_at: DVec2::ZERO,
                pen,
            };
            let paper = Paper::new(&page, 30);
            let params = VolumeParams { reach_mm: 1.5, reach_radii: 0.5, ..VolumeParams::default() };
            let tiles = Tiles::sort(&map, tree.n_nodes(), &paper, &params);
            let mut n_in_reach = 0;
            for y in (0..200).step_by(3) {
                for x in (0..300).step_by(3) {
                    let at = paper.plane_mm(DVec2::new(f64::from(x), f64::from(y)) + 0.5);
                    let owner = map.owner_in_plane(at);
                    let place = map.from_plane(owner, at).place;
                    let radius_mm = map.radius_mm(place);
                    let list = tiles.list(x as usize / TILE, y as usize / TILE);
                    let found = map.owner_among(list.iter().map(|&edge| edge as usize), at);
                    if at.distance(map.plane_at(place)) - radius_mm <= params.reach(radius_mm) {
                        n_in_reach += 1;
                        assert_eq!(found, Some(owner), "{seed} {x} {y}");
                    } else {
                        assert!(found.is_none_or(|found| found == owner), "{seed} {x} {y}");
                    }
                }
            }
            assert!(n_in_reach > 500, "{n_in_reach}");
        }
    }
}
