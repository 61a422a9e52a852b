//! The outline of the ones in a small picture, along the edges of pixels.
//!
//! **Input** width, height, one `bool` a pixel. **Output** the `d` of an SVG path: closed loops with whole corners.
//! **Steps** From each edge with a one below and a nothing above, walk along the border with the ones on the right hand;
//! at a corner where two ones touch only there, turn so that they stay apart.
//! **Guarantees** every border edge is walked once; the result is exact.
//! **Cost** O(pixels).

use std::fmt::Write as _;

/// Right, down, left, up.
const STEPS: [[i64; 2]; 4] = [[1, 0], [0, 1], [-1, 0], [0, -1]];

/// The outline of the ones; `offset` is added to every x.
pub(crate) fn outline([width, height]: [usize; 2], ones: &[bool], offset: i64) -> String {
    let is_one = |x: i64, y: i64| {
        x >= 0 && y >= 0 && x < width as i64 && y < height as i64 && ones[y as usize * width + x as usize]
    };
    // Each loop has an edge that goes right; those are marked when they are walked.
    let mut is_walked = vec![false; width * height];
    let mut out = String::new();
    for index in 0..width * height {
        let [x, y] = [(index % width) as i64, (index / width) as i64];
        if is_walked[index] || !is_one(x, y) || is_one(x, y - 1) {
            continue;
        }
        let _ = write!(out, "M{} {y}", x + offset);
        walk([x, y], &is_one, |[x, y], direction, length| {
            if direction == 0 {
                (0..length).for_each(|step| is_walked[y as usize * width + (x + step) as usize] = true);
            }
            let [dx, dy] = STEPS[direction].map(|step| step * length);
            let _ = if dx == 0 { write!(out, "v{dy}") } else { write!(out, "h{dx}") };
        });
        out.push('z');
    }
    out
}

/// Walks a loop from a corner to the right; tells of each straight stretch where it began, its direction and length.
fn walk(start: [i64; 2], is_one: &impl Fn(i64, i64) -> bool, mut tell: impl FnMut([i64; 2], usize, i64)) {
    let ([mut x, mut y], mut direction) = (start, 0);
    let (mut begun, mut length) = (start, 0);
    loop {
        let [dx, dy] = STEPS[direction];
        [x, y] = [x + dx, y + dy];
        length += 1;
        let next = turned([x, y], direction, is_one);
        let is_closed = [x, y] == start && next == 0;
        if next != direction || is_closed {
            tell(begun, direction, length);
            (begun, length) = ([x, y], 0);
        }
        if is_closed {
            return;
        }
        direction = next;
    }
}

/// Where the border goes on from a corner: to the right if there is a nothing ahead on the right, to the left if there
/// is a one ahead on the left, else straight on.
fn turned([x, y]: [i64; 2], direction: usize, is_one: &impl Fn(i64, i64) -> bool) -> usize {
    // The pixels ahead of the corner, to the left and to the right of the way.
    let [left, right] = match direction {
        0 => [[x, y - 1], [x, y]],
        1 => [[x, y], [x - 1, y]],
        2 => [[x - 1, y], [x - 1, y - 1]],
        _ => [[x - 1, y - 1], [x, y - 1]],
    };
    match (is_one(left[0], left[1]), is_one(right[0], right[1])) {
        (_, false) => (direction + 1) % 4,
        (true, true) => (direction + 3) % 4,
        (false, true) => direction,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(rows: &[&str]) -> String {
        let ones: Vec<bool> = rows.iter().flat_map(|row| row.bytes().map(|byte| byte == b'#')).collect();
        outline([rows[0].len(), rows.len()], &ones, 0)
    }

    #[test]
    fn known_outlines() {
        assert_eq!(of(&["..", ".."]), "");
        assert_eq!(of(&["##", "##"]), "M0 0h2v2h-2v-2z");
        assert_eq!(of(&["#.", ".#"]), "M0 0h1v1h-1v-1zM1 1h1v1h-1v-1z");
        assert_eq!(of(&["##.", "#..", "###"]).matches('z').count(), 1);
        // A ring has an outer and an inner loop.
        assert_eq!(of(&["###", "#.#", "###"]).matches('z').count(), 2);
    }

    #[test]
    fn every_border_edge_is_walked_once() {
        for seed in 0..200_u64 {
            let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
            let ones: Vec<bool> = (0..48)
                .map(|_| {
                    state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                    state >> 40 & 1 == 1
                })
                .collect();
            let is_one =
                |x: i64, y: i64| (0..8).contains(&x) && (0..6).contains(&y) && ones[(y * 8 + x) as usize];
            let pairs = (-1..8).flat_map(|x| (-1..6).map(move |y| (x, y)));
            let n_edges: usize = pairs
                .map(|(x, y)| {
                    usize::from(is_one(x, y) != is_one(x + 1, y))
                        + usize::from(is_one(x, y) != is_one(x, y + 1))
                })
                .sum();
            let path = outline([8, 6], &ones, 0);
            let walked: i64 = path
                .split(['h', 'v', 'z', 'M'])
                .filter(|part| !part.contains(' '))
                .filter_map(|part| part.parse::<i64>().ok())
                .map(i64::abs)
                .sum();
            assert_eq!(walked as usize, n_edges, "{path}");
        }
    }
}
