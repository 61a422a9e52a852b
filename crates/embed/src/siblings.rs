//! Keeping the target angles of siblings apart.
//!
//! **Input** the target angles of the k children of a node. **Output** angles with a stated least gap.
//! **Steps** 1. Order them by angle, equal ones by the view. 2. Take i gaps off the i-th, so that "a gap apart"
//! becomes "not falling". 3. Least squares fit that does not fall (pool adjacent violators). 4. Into the range,
//! and put the gaps back.
//! **Guarantees** the sum of squared changes is least; angles that are far enough apart stay as they are.
//! **Cost** O(k log k).

use std::f64::consts::{PI, TAU};

/// How far target angles keep from 0 and 2π, where an edge would lie on its parent.
pub(crate) const MARGIN_RAD: f64 = 0.02;
/// The widest gap asked for between siblings.
pub(crate) const GAP_RAD: f64 = 0.05;

/// Moves the angles of `children` apart as little as possible.
pub(crate) fn separate(children: &[usize], view_angle_rad: &[f64], angle_rad: &mut [f64]) {
    if children.len() < 2 {
        return;
    }
    let mut order = children.to_vec();
    order.sort_by(|&a, &b| {
        let by_angle = angle_rad[a].total_cmp(&angle_rad[b]);
        by_angle.then(view_angle_rad[a].total_cmp(&view_angle_rad[b])).then(a.cmp(&b))
    });
    let n_children = order.len() as f64;
    let gap = GAP_RAD.min(PI / (n_children + 1.0));
    if order.windows(2).all(|pair| angle_rad[pair[1]] - angle_rad[pair[0]] >= gap)
        && angle_rad[order[0]] >= MARGIN_RAD
        && angle_rad[order[order.len() - 1]] <= TAU - MARGIN_RAD
    {
        return;
    }

    // Pool adjacent violators: each pool is (sum, count) and its mean is the fit.
    let mut pools: Vec<(f64, f64)> = Vec::with_capacity(order.len());
    for (idx, &child) in order.iter().enumerate() {
        pools.push((angle_rad[child] - idx as f64 * gap, 1.0));
        while let [.., (sum_a, n_a), (sum_b, n_b)] = pools[..]
            && sum_a / n_a > sum_b / n_b
        {
            pools.pop();
            if let Some(last) = pools.last_mut() {
                *last = (sum_a + sum_b, n_a + n_b);
            }
        }
    }
    let highest = TAU - MARGIN_RAD - (n_children - 1.0) * gap;
    let mut idx = 0;
    for (sum, count) in pools {
        let fit = (sum / count).clamp(MARGIN_RAD, highest);
        for _ in 0..count as usize {
            angle_rad[order[idx]] = fit + idx as f64 * gap;
            idx += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn separated(angles: &[f64]) -> Vec<f64> {
        let children: Vec<usize> = (0..angles.len()).collect();
        let mut result = angles.to_vec();
        separate(&children, angles, &mut result);
        result
    }

    #[test]
    fn only_what_is_too_near_moves() {
        assert_eq!(separated(&[1.0, 2.0, 4.0]), [1.0, 2.0, 4.0]);
        let apart = separated(&[2.0, 1.0, 2.0]);
        assert!((apart[0] - 1.975).abs() < 1e-12 && (apart[2] - 2.025).abs() < 1e-12 && apart[1] == 1.0);
        assert!((separated(&[0.0, 5.0])[0] - MARGIN_RAD).abs() < 1e-12);
        assert!((separated(&[TAU, 6.27])[0] - (TAU - MARGIN_RAD)).abs() < 1e-12);
    }

    #[test]
    fn five_hundred_equal_siblings_fit() {
        let mut apart = separated(&[PI; 500]);
        apart.sort_by(f64::total_cmp);
        assert!(apart.windows(2).all(|pair| pair[1] - pair[0] > 0.99 * PI / 501.0));
        assert!(apart[0] >= MARGIN_RAD && apart[499] <= TAU - MARGIN_RAD);
    }
}
