//! [`Film`]: what rays are shot through; [`Picture`]: what comes out.

use crate::{Camera, RayCounts, Whitted};
use core::fmt;
use core::ops::ControlFlow;
use core::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use image::codecs::png::PngEncoder;
use image::{DynamicImage, ExtendedColorType, ImageEncoder, ImageFormat};
use rt_accel::Counts;
use rt_geom::glam::{DVec3, Vec3};
use rt_geom::{Ray, Real};
use rt_shapes::Shape;

/// Hears how much of a picture is done, from 0 to 1, and may cancel it. Called from any thread, also from several at once,
/// so a value may be heard after a greater one.
pub type Governor<'a> = &'a (dyn Fn(f32) -> ControlFlow<()> + Sync);

/// A [`Governor`] that lets a picture be finished.
pub fn ungoverned(_progress: f32) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

/// The [`Governor`] said stop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cancelled;

impl fmt::Display for Cancelled {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("the picture was cancelled")
    }
}

impl core::error::Error for Cancelled {}

/// A picture's size, and the tiles it is shot in.
///
/// A film of `w x h` pixels has `(w + 1) x (h + 1)` corners; one ray goes through each, and a pixel is the mean of its four.
/// Tiles are shot in parallel (feature `parallel`, in the rayon pool the caller is in); what comes out depends on neither.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Film {
    width: u32,
    height: u32,
    tile: u32,
}

/// Some corners of a film: a rectangle of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tile {
    /// The least column and row.
    pub from: [u32; 2],
    /// One past the greatest column and row.
    pub to: [u32; 2],
}

impl Tile {
    /// Columns and rows of the corners, row by row.
    pub fn corners(self) -> impl Iterator<Item = [u32; 2]> {
        let Tile { from, to } = self;
        (from[1]..to[1]).flat_map(move |row| (from[0]..to[0]).map(move |column| [column, row]))
    }
}

impl Film {
    /// A film of `width x height` pixels, at least one each, shot in tiles of 32 x 32 corners.
    pub fn new(width: u32, height: u32) -> Film {
        Film { width: width.max(1), height: height.max(1), tile: 32 }
    }

    /// The same film shot in tiles of `side x side` corners, at least one. Larger tiles make longer batches; smaller ones
    /// keep more of a batch in near caches, and more threads busy at the end. From 4 to 128 it made no difference that could
    /// be told from noise (balls, two-wide tree).
    pub fn tiled(self, side: u32) -> Film {
        Film { tile: side.max(1), ..self }
    }

    /// Width and height in pixels.
    pub fn size(&self) -> [u32; 2] {
        [self.width, self.height]
    }

    /// A picture by recursive rays, and the rays that took.
    ///
    /// # Errors
    ///
    /// [`Cancelled`] when `governor` says so.
    pub fn render<R: Real, P: Shape<R> + ?Sized, M: Fn(&P::At) -> u32 + Sync>(
        &self,
        camera: &Camera,
        whitted: &Whitted<'_, P, M>,
        governor: Governor<'_>,
    ) -> Result<(Picture, RayCounts), Cancelled> {
        let (colors, rays) = self.shoot(governor, |tile| whitted.colors::<R>(self.eyes(camera, tile)))?;
        let mut sum = RayCounts::default();
        rays.into_iter().for_each(|part| sum += part);
        Ok((self.develop(&colors), sum))
    }

    /// The work of all queries of a picture, one ray after another, and the rays that took.
    ///
    /// # Errors
    ///
    /// [`Cancelled`] when `governor` says so.
    pub fn work<R: Real, P: Shape<R> + ?Sized, M: Fn(&P::At) -> u32 + Sync>(
        &self,
        camera: &Camera,
        whitted: &Whitted<'_, P, M>,
        governor: Governor<'_>,
    ) -> Result<(Counts, RayCounts), Cancelled> {
        let (_, parts) = self.shoot(governor, |tile| {
            let (colors, rays, work) = whitted.colors_counted::<R>(self.eyes(camera, tile));
            (colors, (work, rays))
        })?;
        let mut sum = (Counts::default(), RayCounts::default());
        for (work, rays) in parts {
            sum.0 += work;
            sum.1 += rays;
        }
        Ok(sum)
    }

    /// Shading normals as colours: `(n + 1) / 2`, red for x, green for y, blue for z; black where nothing is. Needs no light
    /// and no material, and shows every bit of geometry: for reference pictures.
    ///
    /// # Errors
    ///
    /// [`Cancelled`] when `governor` says so.
    pub fn normals<R: Real, P: Shape<R> + ?Sized>(
        &self,
        camera: &Camera,
        shape: &P,
        governor: Governor<'_>,
    ) -> Result<Picture, Cancelled> {
        let (colors, _) = self.shoot(governor, |tile| {
            let eyes = self.eyes(camera, tile);
            let mut hits = vec![None; eyes.len()];
            shape.intersect_many(&eyes, &mut hits);
            let color = |(ray, hit): (&Ray<R>, &Option<_>)| match hit {
                Some(hit) => ((shape.surface(ray, hit).shading + DVec3::ONE) * 0.5).as_vec3().to_array(),
                None => [0.0; 3],
            };
            (eyes.iter().zip(&hits).map(color).collect(), ())
        })?;
        Ok(self.develop(&colors))
    }

    /// The nodes, leaves and primitives that each corner's eye ray met, row by row.
    ///
    /// # Errors
    ///
    /// [`Cancelled`] when `governor` says so.
    pub fn cost<R: Real, P: Shape<R> + ?Sized>(
        &self,
        camera: &Camera,
        shape: &P,
        governor: Governor<'_>,
    ) -> Result<Vec<Counts>, Cancelled> {
        let (costs, _) = self.shoot(governor, |tile| {
            let cost = |ray: &Ray<R>| {
                let mut counts = Counts::default();
                shape.intersect_counted(ray, &mut counts);
                counts
            };
            (self.eyes(camera, tile).iter().map(cost).collect(), ())
        })?;
        Ok(costs)
    }

    /// The eye rays of a tile.
    fn eyes<R: Real>(&self, camera: &Camera, tile: Tile) -> Vec<Ray<R>> {
        tile.corners().map(|corner| camera.corner(corner, self.size())).collect()
    }

    fn tiles(&self) -> Vec<Tile> {
        // Corner counts may be one more than u32 holds.
        let (columns, rows) = (u64::from(self.width) + 1, u64::from(self.height) + 1);
        let side = u64::from(self.tile);
        let cut =
            |n: u64| (0..n.div_ceil(side)).map(move |i| ((i * side) as u32, ((i + 1) * side).min(n) as u32));
        cut(rows)
            .flat_map(|(top, bottom)| {
                cut(columns).map(move |(left, right)| Tile { from: [left, top], to: [right, bottom] })
            })
            .collect()
    }

    /// Shoots every tile: a value per corner, put in rows, and one per tile, in order.
    fn shoot<T: Copy + Default + Send, A: Send>(
        &self,
        governor: Governor<'_>,
        shoot: impl Fn(Tile) -> (Vec<T>, A) + Sync,
    ) -> Result<(Vec<T>, Vec<A>), Cancelled> {
        let tiles = self.tiles();
        let (stopped, done) = (AtomicBool::new(governor(0.0).is_break()), AtomicUsize::new(0));
        let one = |&tile: &Tile| {
            if stopped.load(Ordering::Relaxed) {
                return None;
            }
            let shot = shoot(tile);
            let done = done.fetch_add(1, Ordering::Relaxed) + 1;
            if governor(done as f32 / tiles.len() as f32).is_break() {
                stopped.store(true, Ordering::Relaxed);
            }
            Some(shot)
        };
        #[cfg(feature = "parallel")]
        let shot: Vec<_> = rayon::iter::ParallelIterator::collect(rayon::iter::ParallelIterator::map(
            rayon::iter::IntoParallelRefIterator::par_iter(&tiles),
            one,
        ));
        #[cfg(not(feature = "parallel"))]
        let shot: Vec<_> = tiles.iter().map(one).collect();
        let columns = self.width as usize + 1;
        let mut corners = vec![T::default(); columns * (self.height as usize + 1)];
        let mut parts = Vec::with_capacity(tiles.len());
        for (tile, shot) in tiles.iter().zip(shot) {
            let (values, part) = shot.ok_or(Cancelled)?;
            for ([column, row], value) in tile.corners().zip(values) {
                corners[row as usize * columns + column as usize] = value;
            }
            parts.push(part);
        }
        Ok((corners, parts))
    }

    /// Pixels from corners.
    pub(crate) fn develop(&self, corners: &[[f32; 3]]) -> Picture {
        let columns = self.width as usize + 1;
        let corner = |x: usize, y: usize| Vec3::from(corners[y * columns + x]);
        let pixel = |x, y| (corner(x, y) + corner(x + 1, y)) + (corner(x, y + 1) + corner(x + 1, y + 1));
        let mut picture = Picture::new(self.width, self.height);
        for y in 0..self.height as usize {
            for x in 0..self.width as usize {
                picture.pixels[y * self.width as usize + x] = (pixel(x, y) * 0.25).to_array();
            }
        }
        picture
    }
}

/// Pixels: red, green, blue, row by row from the top; 0 is dark, 1 is full.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// The pixels, `width * height` of them.
    pub pixels: Vec<[f32; 3]>,
}

/// Why a picture did not become a PNG file, or a file a picture.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PngError(String);

impl fmt::Display for PngError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "not a PNG file: {}", self.0)
    }
}

impl core::error::Error for PngError {}

impl Picture {
    /// A black picture.
    pub fn new(width: u32, height: u32) -> Picture {
        Picture { width, height, pixels: vec![[0.0; 3]; width as usize * height as usize] }
    }

    /// The pixels as bytes: clamped to `[0, 1]`, NaN to 0, and rounded to the nearest of 256 steps. The numbers are taken for
    /// what a screen is told, as colours of the Standard Procedural Databases are: no gamma is applied.
    pub fn bytes(&self) -> Vec<u8> {
        // A NaN becomes 0 in the cast.
        self.pixels.iter().flatten().map(|&c| (c.clamp(0.0, 1.0) * 255.0).round() as u8).collect()
    }

    /// The bytes of a PNG file.
    ///
    /// # Errors
    ///
    /// When `pixels` are not `width * height`, or the picture is empty.
    pub fn png(&self) -> Result<Vec<u8>, PngError> {
        if self.pixels.len() != self.width as usize * self.height as usize {
            return Err(PngError("the number of pixels is not width times height".into()));
        }
        let mut file = Vec::new();
        PngEncoder::new(&mut file)
            .write_image(&self.bytes(), self.width, self.height, ExtendedColorType::Rgb8)
            .map_err(|e| PngError(e.to_string()))?;
        Ok(file)
    }

    /// The picture in a PNG file of eight-bit red, green and blue, as [`Picture::png`] makes them.
    ///
    /// # Errors
    ///
    /// When the bytes are no PNG file, or one of other colours.
    pub fn from_png(file: &[u8]) -> Result<Picture, PngError> {
        let image = image::load_from_memory_with_format(file, ImageFormat::Png)
            .map_err(|e| PngError(e.to_string()))?;
        let DynamicImage::ImageRgb8(image) = image else {
            return Err(PngError("its colours are not eight-bit red, green and blue".into()));
        };
        let pixels = image.pixels().map(|p| p.0.map(|c| f32::from(c) / 255.0)).collect();
        Ok(Picture { width: image.width(), height: image.height(), pixels })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Look;
    use rt_accel::{Aggregate, Exhaustive, Member};
    use rt_scenes::{Scene, SceneGeometry, Solid};

    fn balls() -> (Aggregate<Exhaustive, Vec<Solid>>, Scene) {
        let scene = rt_scenes::by_name("balls", Some(1)).unwrap();
        let SceneGeometry::Solids(solids) = scene.geometry.clone() else { panic!("balls are solids") };
        (Aggregate::build(solids, &()).unwrap(), scene)
    }

    #[test]
    fn pictures_do_not_depend_on_tiles_and_threads() {
        let (shape, scene) = balls();
        let look = Look { materials: &scene.materials, lights: &scene.lights, background: scene.background };
        let material_of = |at: &Member<_>| scene.material_of.get(at.prim as usize).copied().unwrap_or(0);
        let whitted = Whitted::new(&shape, material_of, look);
        let camera = Camera::new(&scene.view).unwrap();
        let film = Film::new(50, 41);
        let render = |film: Film| film.render::<f32, _, _>(&camera, &whitted, &ungoverned).unwrap();
        let (picture, rays) = render(film);
        assert_eq!((rays.eye, rays.eye_hits), (51 * 42, 51 * 42));
        assert!(rays.reflection > 0 && rays.occluded > 0);
        assert!(render(film.tiled(1)) == (picture.clone(), rays));
        assert!(render(film.tiled(1000)) == (picture.clone(), rays));
        #[cfg(feature = "parallel")]
        for threads in [1, 3] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            assert!(pool.install(|| render(film.tiled(7))) == (picture.clone(), rays));
        }
        let (_, counted) = film.work::<f32, _, _>(&camera, &whitted, &ungoverned).unwrap();
        assert_eq!(counted, rays);
    }

    #[test]
    fn a_picture_can_be_cancelled() {
        let (shape, scene) = balls();
        let camera = Camera::new(&scene.view).unwrap();
        let heard = AtomicUsize::new(0);
        let stop = |progress: f32| {
            heard.fetch_add(1, Ordering::Relaxed);
            if progress > 0.2 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        let film = Film::new(100, 100).tiled(5);
        assert_eq!(film.normals::<f32, _>(&camera, &shape, &stop), Err(Cancelled));
        assert!(heard.into_inner() < 200);
        assert_eq!(film.normals::<f32, _>(&camera, &shape, &|_| ControlFlow::Break(())), Err(Cancelled));
    }

    #[test]
    fn corners_are_averaged() {
        let film = Film::new(2, 1);
        let corners = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0].map(|c| [c; 3]);
        assert_eq!(film.develop(&corners).pixels, [[2.0; 3], [3.0; 3]]);
        assert_eq!(Film::new(0, 0).size(), [1, 1]);
    }

    #[test]
    fn bytes_are_clamped_and_files_are_whole() {
        let mut picture = Picture::new(2, 1);
        picture.pixels = vec![[-1.0, 0.5, 7.0], [f32::NAN, f32::INFINITY, 1.0]];
        assert_eq!(picture.bytes(), [0, 128, 255, 0, 255, 255]);
        let file = picture.png().unwrap();
        let read = Picture::from_png(&file).unwrap();
        assert_eq!((read.width, read.height, read.bytes()), (2, 1, picture.bytes()));
        assert!(Picture::from_png(&file[..file.len() / 2]).is_err() && Picture::from_png(b"").is_err());
        picture.pixels.pop();
        assert!(picture.png().is_err());
        assert!(Picture::new(0, 3).png().is_err());
    }
}
