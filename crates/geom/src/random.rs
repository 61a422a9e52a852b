//! Counter-based random streams: Philox4x32-10.
//!
//! A number depends on (seed, stage, particle, iteration, position in the stream) and on nothing else: not on
//! the thread that draws it, nor on how many were drawn elsewhere. Only 32-bit integer arithmetic is used, so
//! that a GPU can draw the same numbers.
//!
//! **Source** [Salmon2011] section 3.3, 10 rounds; known-answer vectors of their Random123 distribution.

use crate::math;

const MULTIPLIERS: [u32; 2] = [0xD251_1F53, 0xCD9E_8D57];
const WEYL: [u32; 2] = [0x9E37_79B9, 0xBB67_AE85];
const ROUNDS: u32 = 10;

/// What a stream is for; a part of its key, so that two stages never share numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Purpose {
    /// Shape of a phantom.
    PhantomShape = 1,
    /// Noise of a phantom CT.
    PhantomNoise = 2,
    /// Start of a view-finding swarm.
    ViewSwarm = 3,
    /// Start of an embedding swarm.
    SwarmStart = 4,
    /// Steps of an embedding swarm.
    SwarmStep = 5,
    /// The search for the sides of turns.
    MirrorSearch = 6,
    /// Tests.
    Test = 99,
}

/// A stream of random numbers; cheap to make, so make one where it is needed.
#[derive(Clone, Debug)]
pub struct Stream {
    key: [u32; 2],
    counter: [u32; 4],
    block: [u32; 4],
    n_used: usize,
}

impl Stream {
    /// The stream of one (seed, purpose, particle, iteration).
    #[must_use]
    pub fn new(seed: u64, purpose: Purpose, particle: u32, iteration: u32) -> Self {
        Self {
            key: [seed as u32, (seed >> 32) as u32],
            counter: [0, purpose as u32, particle, iteration],
            block: [0; 4],
            n_used: 4,
        }
    }

    /// The next 32 random bits.
    pub fn next_u32(&mut self) -> u32 {
        if self.n_used == 4 {
            self.block = philox4x32(self.counter, self.key);
            self.counter[0] = self.counter[0].wrapping_add(1);
            self.n_used = 0;
        }
        self.n_used += 1;
        self.block[self.n_used - 1]
    }

    /// Uniform in [0, 1), with 32 bits.
    pub fn unit(&mut self) -> f64 {
        f64::from(self.next_u32()) / 4_294_967_296.0
    }

    /// Uniform in [low, high).
    pub fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// Uniform in 0..n; 0 when n is 0.
    pub fn below(&mut self, n: u32) -> u32 {
        // Multiply-shift: the bias is below n / 2³², which no use here can see.
        ((u64::from(self.next_u32()) * u64::from(n)) >> 32) as u32
    }

    /// Standard normal (Box–Muller, one of the pair).
    pub fn normal(&mut self) -> f64 {
        let radius = (-2.0 * math::ln(1.0 - self.unit())).sqrt();
        radius * math::cos(std::f64::consts::TAU * self.unit())
    }
}

fn philox4x32(mut counter: [u32; 4], mut key: [u32; 2]) -> [u32; 4] {
    for round in 0..ROUNDS {
        if round > 0 {
            key = [key[0].wrapping_add(WEYL[0]), key[1].wrapping_add(WEYL[1])];
        }
        let product0 = u64::from(MULTIPLIERS[0]) * u64::from(counter[0]);
        let product1 = u64::from(MULTIPLIERS[1]) * u64::from(counter[2]);
        counter = [
            (product1 >> 32) as u32 ^ counter[1] ^ key[0],
            product1 as u32,
            (product0 >> 32) as u32 ^ counter[3] ^ key[1],
            product0 as u32,
        ];
    }
    counter
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Known-answer vectors `philox4x32 10` of Random123.
    #[test]
    fn known_answers() {
        assert_eq!(philox4x32([0; 4], [0; 2]), [0x6627_e8d5, 0xe169_c58d, 0xbc57_ac4c, 0x9b00_dbd8]);
        assert_eq!(
            philox4x32([u32::MAX; 4], [u32::MAX; 2]),
            [0x408f_276d, 0x41c8_3b0e, 0xa20b_c7c6, 0x6d54_51fd]
        );
        assert_eq!(
            philox4x32([0x243f_6a88, 0x85a3_08d3, 0x1319_8a2e, 0x0370_7344], [0xa409_3822, 0x299f_31d0]),
            [0xd16c_fe09, 0x94fd_cceb, 0x5001_e420, 0x2412_6ea1]
        );
    }

    #[test]
    fn moments_are_right() {
        let mut stream = Stream::new(7, Purpose::Test, 0, 0);
        let n = 20_000;
        let (mut mean, mut variance, mut unit_mean) = (0.0, 0.0, 0.0);
        for _ in 0..n {
            let x = stream.normal();
            mean += x / f64::from(n);
            variance += x * x / f64::from(n);
            unit_mean += stream.unit() / f64::from(n);
        }
        assert!(mean.abs() < 0.03 && (variance - 1.0).abs() < 0.05 && (unit_mean - 0.5).abs() < 0.01);
    }
}
