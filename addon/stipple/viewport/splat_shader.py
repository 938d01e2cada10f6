# SPDX-License-Identifier: GPL-3.0-or-later
"""Shaders and batches that draw splats as blended quads on a graphics card.

The card projects as native/splat/render/projection.h does. Geometry, rows of the order and instances lie in
float textures, since Blender's Python has no storage buffers; texels of one kind follow each other
in rows of TEXTURE_SPLATS splats, as textures are no wider than a few thousand texels.
Based on: Zwicker et al., EWA Volume Splatting, Visualization 2001; Yu et al., Mip-Splatting, CVPR 2024.
"""

import gpu
import numpy as np

from ..binding.errors import StippleError
from ..binding.structs import Status

# Splats per row of texels: 3 texels each are 12,288 of the 16,384 that OpenGL 4 cards offer.
TEXTURE_SPLATS = 4096
GEOMETRY_TEXELS = 3
INSTANCE_TEXELS = 4
INSTANCES_PER_ROW = 256
# Quads of one batch; a draw call takes as many batches as it needs.
BATCH_QUADS = 4096
CLIP_PLANES = 6

_VERTEX = '''
vec4 geometryTexel(int row, int part)
{
  return texelFetch(geometry, ivec2(3 * (row % TEXTURE_SPLATS) + part, row / TEXTURE_SPLATS), 0);
}

vec4 instanceTexel(int number, int part)
{
  /* The first row holds the clipping planes. */
  return texelFetch(instances, ivec2(4 * (number % INSTANCES_PER_ROW) + part, 1 + number / INSTANCES_PER_ROW), 0);
}

void main()
{
  /* What does not show goes to one point outside the picture. */
  gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
  offset = vec2(0.0);
  colour = vec4(0.0);
  int place = first + BATCH_NUMBER * BATCH_QUADS + gl_VertexID / 4;
  if (place >= count) {
    return;
  }
  vec4 row = texelFetch(rows, ivec2(place % TEXTURE_SPLATS, place / TEXTURE_SPLATS), 0);
  int splat = int(row.x);
  int number = int(row.y);
  vec4 state = instanceTexel(number, 3); /* low-pass variance, compensated, opacity, selected */
  if (state.z == 0.0) {
    return;
  }
  vec4 placed = geometryTexel(splat, 0); /* position, opacity */
  vec4 m0 = instanceTexel(number, 0);
  vec4 m1 = instanceTexel(number, 1);
  vec4 m2 = instanceTexel(number, 2);
  vec4 position = vec4(placed.xyz, 1.0);
  vec3 centre = vec3(dot(m0, position), dot(m1, position), dot(m2, position));
  if (centre.z < range.x || centre.z > range.y) {
    return;
  }
  for (int i = 0; i < clipCount; i++) {
    if (dot(texelFetch(instances, ivec2(i, 0), 0), vec4(centre, 1.0)) > 0.0) {
      return;
    }
  }

  /* Columns of the object's own axes times standard deviations, then in the camera's frame. */
  vec4 q = normalize(geometryTexel(splat, 1));
  vec3 scales = geometryTexel(splat, 2).xyz;
  vec3 a0 = vec3(1.0 - 2.0 * (q.z * q.z + q.w * q.w), 2.0 * (q.y * q.z + q.x * q.w), 2.0 * (q.y * q.w - q.x * q.z));
  vec3 a1 = vec3(2.0 * (q.y * q.z - q.x * q.w), 1.0 - 2.0 * (q.y * q.y + q.w * q.w), 2.0 * (q.z * q.w + q.x * q.y));
  vec3 a2 = vec3(2.0 * (q.y * q.w + q.x * q.z), 2.0 * (q.z * q.w - q.x * q.y), 1.0 - 2.0 * (q.y * q.y + q.z * q.z));
  mat3 own = mat3(a0 * scales.x, a1 * scales.y, a2 * scales.z);
  vec3 alongX = m0.xyz * own, alongY = m1.xyz * own, alongZ = m2.xyz * own;

  /* Rows of the 2x3 matrix whose product with its transpose is the covariance in pixels. */
  vec2 mean;
  vec3 x, y;
  if (perspective != 0) {
    vec2 slope = centre.xy / centre.z;
    mean = lens.xy * slope + lens.zw;
    vec2 held = clamp(slope, slopes.xy, slopes.zw);
    x = lens.x / centre.z * (alongX - held.x * alongZ);
    y = lens.y / centre.z * (alongY - held.y * alongZ);
  }
  else {
    mean = lens.xy * centre.xy + lens.zw;
    x = lens.x * alongX;
    y = lens.y * alongY;
  }
  float r00 = sqrt(dot(x, x) + state.x);
  float s = sqrt(state.x);
  vec4 u = vec4(x, s) / r00;
  float r01 = dot(u.xyz, y);
  vec4 v = vec4(y - r01 * u.xyz, r01 * u.w);
  float r11 = sqrt(dot(v, v) + state.x);
  float opacity = placed.w * state.z;
  if (state.y != 0.0) {
    /* The low-pass keeps a splat's light. */
    float sharp00 = length(x);
    vec3 sharp = y - (sharp00 > 0.0 ? dot(x, y) / (sharp00 * sharp00) : 0.0) * x;
    opacity *= sharp00 / r00 * (length(sharp) / r11);
  }
  float least = 1.0 / 255.0;
  if (!(opacity >= least)) {
    return;
  }

  /* A square around the disc where alpha >= 1/255, under the covariance's Cholesky factor. */
  float reach = sqrt(2.0 * log(opacity / least)) + 0.01;
  int corner = gl_VertexID % 4;
  offset = reach * vec2(corner == 1 || corner == 2 ? 1.0 : -1.0, corner >= 2 ? 1.0 : -1.0);
  vec2 pixel = mean + vec2(r00 * offset.x, r01 * offset.x + r11 * offset.y);

  int high = int(row.z), low = int(row.w);
  vec3 steps = vec3(float(high >> 8), float((high & 255) * 256 + (low >> 16)), float(low & 65535)) / 65535.0;
  colour = vec4(64.0 * steps * steps, opacity);
#ifdef WITH_SELECTION
  selected = state.w;
#endif
  /* The camera looks along +z with y down; Blender's clip space has y up. */
  float along = range.w - centre.z;
  float depth = depths.x * along + depths.y;
  gl_Position = vec4(2.0 * pixel.x / size.x - 1.0, 1.0 - 2.0 * pixel.y / size.y,
                     perspective != 0 ? depth / -along : depth, 1.0);
}
'''

_FRAGMENT = '''
void main()
{
  float alpha = min(0.99, colour.a * exp(-0.5 * dot(offset, offset)));
  if (alpha < 1.0 / 255.0) {
    discard;
  }
  picture = vec4(colour.rgb * alpha, alpha);
#ifdef WITH_SELECTION
  selection = vec4(selected * alpha, 0.0, 0.0, alpha);
#endif
}
'''

_SHOW_VERTEX = '''
void main()
{
  gl_Position = vec4(corner, 0.0, 1.0);
}
'''

_SHOW_FRAGMENT = '''
#ifdef WITH_SELECTION
bool isSelected(ivec2 at)
{
  return texelFetch(selection, clamp(at, ivec2(0), textureSize(selection, 0) - 1), 0).r > 0.5;
}
#endif

void main()
{
  ivec2 at = ivec2(gl_FragCoord.xy) - origin;
  vec4 value = texelFetch(picture, at, 0);
#ifdef WITH_SELECTION
  bool here = isSelected(at);
  bool edge = false;
  for (int x = -1; x <= 1; x++) {
    for (int y = -1; y <= 1; y++) {
      edge = edge || isSelected(at + ivec2(x, y)) != here;
    }
  }
  if (edge && !here) {
    value = vec4(outline, 1.0);
  }
#endif
  if (value.a <= 0.0) {
    discard;
  }
  /* Values are for the display; a target that encodes them itself wants them linear. */
  if (srgbTarget) {
    vec3 c = max(value.rgb, vec3(0.0));
    value.rgb = mix(c / 12.92, pow((c + 0.055) / 1.055, vec3(2.4)), step(vec3(0.04045), c));
  }
  shown = value;
}
'''


class ShaderError(StippleError):
    """This machine's graphics cannot compile the shaders."""


class Shaders:
    """The compiled shaders. Errors: ShaderError."""

    def __init__(self):
        self.instanced = hasattr(gpu.types.GPUBatch, 'draw_instanced')
        self._splats, self._show = {}, {}
        self._quads = self._make_quads()
        self._screen = self._make_screen()

    def splats(self, with_selection):
        if with_selection not in self._splats:
            self._splats[with_selection] = _compile(self._splat_info(with_selection))
        return self._splats[with_selection]

    def show(self, with_selection):
        if with_selection not in self._show:
            self._show[with_selection] = _compile(self._show_info(with_selection))
        return self._show[with_selection]

    def draw_quads(self, shader, count):
        """Draws splats 0..count of the bound shader, in their order."""
        batches = -(-count // BATCH_QUADS)
        shader.uniform_int('count', count)
        shader.uniform_int('first', 0)
        if self.instanced:
            self._quads.draw_instanced(shader, instance_start=0, instance_count=batches)
            return
        for batch in range(batches):
            shader.uniform_int('first', batch * BATCH_QUADS)
            self._quads.draw(shader)

    def draw_screen(self, shader):
        self._screen.draw(shader)

    def _splat_info(self, with_selection):
        info = gpu.types.GPUShaderCreateInfo()
        info.define('TEXTURE_SPLATS', str(TEXTURE_SPLATS))
        info.define('INSTANCES_PER_ROW', str(INSTANCES_PER_ROW))
        info.define('BATCH_QUADS', str(BATCH_QUADS))
        info.define('BATCH_NUMBER', 'gl_InstanceID' if self.instanced else '0')
        between = gpu.types.GPUStageInterfaceInfo(f'stipple_splat_{int(with_selection)}')
        between.no_perspective('VEC2', 'offset')
        between.flat('VEC4', 'colour')
        if with_selection:
            info.define('WITH_SELECTION')
            between.flat('FLOAT', 'selected')
        for i, name in enumerate(('rows', 'geometry', 'instances')):
            info.sampler(i, 'FLOAT_2D', name)
        for kind, name in (('VEC4', 'lens'), ('VEC4', 'slopes'), ('VEC4', 'range'), ('VEC2', 'depths'),
                           ('VEC2', 'size'), ('INT', 'perspective'), ('INT', 'clipCount'), ('INT', 'count'),
                           ('INT', 'first')):
            info.push_constant(kind, name)
        info.vertex_in(0, 'FLOAT', 'unused')
        info.vertex_out(between)
        info.fragment_out(0, 'VEC4', 'picture')
        if with_selection:
            info.fragment_out(1, 'VEC4', 'selection')
        info.vertex_source(_VERTEX)
        info.fragment_source(_FRAGMENT)
        # The interface must live until the shader has been made.
        return info, between

    @staticmethod
    def _show_info(with_selection):
        info = gpu.types.GPUShaderCreateInfo()
        info.sampler(0, 'FLOAT_2D', 'picture')
        if with_selection:
            info.define('WITH_SELECTION')
            info.sampler(1, 'FLOAT_2D', 'selection')
            info.push_constant('VEC3', 'outline')
        info.push_constant('IVEC2', 'origin')
        # A name that Blender knows: it is set for the target that is bound.
        info.push_constant('BOOL', 'srgbTarget')
        info.vertex_in(0, 'VEC2', 'corner')
        info.fragment_out(0, 'VEC4', 'shown')
        info.vertex_source(_SHOW_VERTEX)
        info.fragment_source(_SHOW_FRAGMENT)
        return info, None

    @staticmethod
    def _make_quads():
        """BATCH_QUADS quads; the shader makes corners from their numbers."""
        layout = gpu.types.GPUVertFormat()
        layout.attr_add(id='unused', comp_type='F32', len=1, fetch_mode='FLOAT')
        vertices = gpu.types.GPUVertBuf(format=layout, len=4 * BATCH_QUADS)
        vertices.attr_fill(id='unused', data=np.zeros((4 * BATCH_QUADS, 1), np.float32))
        quads = 4 * np.arange(BATCH_QUADS, dtype=np.int32)[:, None] + np.array([0, 1, 2, 0, 2, 3], np.int32)
        return gpu.types.GPUBatch(type='TRIS', buf=vertices,
                                  elem=gpu.types.GPUIndexBuf(type='TRIS', seq=quads.reshape(-1, 3)))

    @staticmethod
    def _make_screen():
        layout = gpu.types.GPUVertFormat()
        layout.attr_add(id='corner', comp_type='F32', len=2, fetch_mode='FLOAT')
        vertices = gpu.types.GPUVertBuf(format=layout, len=3)
        vertices.attr_fill(id='corner', data=np.array([[-1, -1], [3, -1], [-1, 3]], np.float32))
        return gpu.types.GPUBatch(type='TRIS', buf=vertices)


def _compile(info_and_kept):
    try:
        return gpu.shader.create_from_info(info_and_kept[0])
    except Exception as error:  # Blender raises plain exceptions of several types here
        raise ShaderError(f'The graphics driver cannot compile the shader of splats ({error}); splats are drawn as '
                           'points.', Status.ERROR_UNAVAILABLE) from None


def texture(array, width):
    """A float texture of `array` [texels,4], `width` texels in a row."""
    flat = array.reshape(-1)
    return gpu.types.GPUTexture((width, flat.size // (4 * width)), format='RGBA32F',
                                data=gpu.types.Buffer('FLOAT', flat.size, flat))
